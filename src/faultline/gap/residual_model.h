// The runs of a gap diagnosis with their noise, and a model's residuals over them (segments/segment_model.h).
#pragma once

#include <Eigen/Core>

#include "faultline/gap/gap_options.h"
#include "faultline/segments/segment_model.h"

namespace faultline {

class ResidualModel {
 public:
  ResidualModel(const Datasheet& sheet, std::vector<SegmentedRun> runs, const GapOptions& options = {});

  const SegmentModel& model() const { return model_; }
  const Datasheet& sheet() const { return model_.sheet(); }
  const std::vector<SegmentedRun>& runs() const { return runs_; }
  const std::vector<int>& outputs() const { return model_.outputs(); }  // channels that count
  const std::vector<double>& noise() const { return noise_; }           // per output, channel's unit
  // Readings that a whole segment has; where runs have different periods, in the first of them.
  double segment_values() const { return static_cast<double>(runs_.front().segment * outputs().size()); }
  const GapOptions& options() const { return options_; }  // of all that works with these residuals

  // Normalised residuals of one run, rows x outputs.
  Eigen::MatrixXf residuals(const ModelChange& model, std::size_t run) const;
  // The same with the states put back every `horizon` samples, and the first `horizon` rows after each counted.
  Eigen::MatrixXf residuals(const ModelChange& model, std::size_t run, std::size_t horizon) const;
  // d residuals / d shift of the start states: one matrix per direction.
  std::vector<Eigen::MatrixXf> start_sensitivity(const ModelChange& model, std::size_t run) const;
  // SegmentModel::settle() of a run.
  std::vector<Eigen::MatrixXf> settle_starts(const ModelChange& model, std::size_t run,
                                             std::vector<Eigen::MatrixXf> known = {});

 private:
  SegmentModel model_;
  std::vector<SegmentedRun> runs_;
  GapOptions options_;
  std::vector<double> noise_;
};

}  // namespace faultline

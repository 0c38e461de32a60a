// The runs of a gap diagnosis with their noise, and a model's residuals over them (segments/segment_model.h).
#pragma once

#include <algorithm>

#include <Eigen/Core>

#include "faultline/gap/gap_options.h"
#include "faultline/segments/segment_model.h"
#include "faultline/segments/state_smoother.h"

namespace faultline {

// Per run; run_phases.h.
struct RunPhases {
  std::vector<double> ahead, turned;
  double closed = 0;  // of the mean square of residuals, by what swings so
};

class ResidualModel {
 public:
  ResidualModel(const Datasheet& sheet, std::vector<SegmentedRun> runs, const GapOptions& options = {})
      : model_(sheet, options.segments), runs_(std::move(runs)), options_(options), noise_(place_all(model_, runs_)) {}

  // The same over some segments of each run.
  ResidualModel part(const std::vector<std::vector<std::size_t>>& segments) const {
    ResidualModel result = *this;
    for (std::size_t r = 0; r < runs_.size(); ++r)
      if (segments[r].size() < runs_[r].segments()) result.runs_[r] = some_segments(runs_[r], segments[r]);
    return result;
  }

  // The same over other runs, whose starts are placed already.
  ResidualModel over(std::vector<SegmentedRun> runs) const {
    return ResidualModel(model_, std::move(runs), options_, noise_);
  }

  // The same over one of its runs.
  ResidualModel only(std::size_t run) const { return over({runs_[run]}); }

  const SegmentModel& model() const { return model_; }
  const Datasheet& sheet() const { return model_.sheet(); }
  const std::vector<SegmentedRun>& runs() const { return runs_; }
  const std::vector<int>& outputs() const { return model_.outputs(); }  // channels that count
  const std::vector<double>& noise() const { return noise_; }           // per output, channel's unit
  // Readings that a whole segment counts for.
  double segment_values() const { return static_cast<double>(fewest_rows(runs_) * outputs().size()); }
  const GapOptions& options() const { return options_; }  // of all that works with these residuals

  // SegmentedRun::ahead and turned of each run.
  void put_in_step(const RunPhases& phases) {
    for (std::size_t r = 0; r < runs_.size(); ++r) runs_[r].ahead = phases.ahead[r], runs_[r].turned = phases.turned[r];
  }

  // Normalised residuals of one run, rows x outputs.
  Eigen::MatrixXf residuals(const ModelChange& model, std::size_t run) const {
    return model_.residuals(model, runs_[run], noise_);
  }
  // The same with the states put back every `horizon` samples, and the first `horizon` rows after each counted.
  Eigen::MatrixXf residuals(const ModelChange& model, std::size_t run, std::size_t horizon) const {
    return model_.residuals(model, runs_[run], noise_, horizon);
  }
  // d residuals / d shift of the start states: one matrix per direction.
  std::vector<Eigen::MatrixXf> start_sensitivity(const ModelChange& model, std::size_t run, int jobs = 1) const {
    return model_.start_columns(model, runs_[run], noise_, jobs);
  }
  // SegmentModel::settle() of a run. Hidden states and what is known behind sensors with effects are as the model at
  // hand has them, unless it has hardly moved.
  std::vector<Eigen::MatrixXf> settle_starts(const ModelChange& model, std::size_t run,
                                             std::vector<Eigen::MatrixXf> known = {}, int jobs = 1) {
    const bool at_sensor = std::any_of(model.effects.begin(), model.effects.end(), [](const EffectSpec& effect) {
      return port_kind(effect.port) == PortKind::sensor;
    });
    if (known.empty() && (at_sensor || !hidden_states(model_, runs_[run]).empty()))
      model_.place_starts(runs_[run], noise_, model);
    return model_.settle(model, runs_[run], noise_, std::move(known), jobs);
  }

 private:
  ResidualModel(const SegmentModel& model, std::vector<SegmentedRun> runs, const GapOptions& options,
                const std::vector<double>& noise)
      : model_(model), runs_(std::move(runs)), options_(options), noise_(noise) {}

  SegmentModel model_;
  std::vector<SegmentedRun> runs_;
  GapOptions options_;
  std::vector<double> noise_;
};

}  // namespace faultline

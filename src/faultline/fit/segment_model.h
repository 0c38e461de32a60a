// A rig's model against recordings, in segments: an integrating plant cannot run free for long, so at the head of
// every segment its states are put back to smoothed measurements. What is wrong with those start states is projected
// out to first order, as if each were estimated along with everything else:
//
//   r_w = (I + S S')^(-1/2) r,   r = (y - y_model)/sigma,   S = d r/d start, per standard error of the smoothed start
//
// Channels that are ground truth are not used; commands that are ground truth count as 0.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "faultline/fit/fit_options.h"
#include "faultline/rig/simulator.h"

namespace faultline {

// One recording, cut into segments of equal length.
struct SegmentedRun {
  std::string name;
  Recording recording;                // channels in the datasheet's order
  std::vector<std::size_t> restarts;  // first row of each segment
  std::vector<double> starts;         // segments x states; NaN where no channel shows the state: it runs on
  std::vector<double> start_errors;   // likewise, standard errors
};

// What the model is changed by.
struct ModelChange {
  std::vector<double> parameters;   // in the datasheet's order
  std::vector<EffectSpec> effects;  // on top of the datasheet's nominal effects
};

class SegmentModel {
 public:
  // `segment` in samples, at least 20.
  SegmentModel(const Datasheet& sheet, std::size_t segment, const SegmentOptions& options = {});

  // Cuts and checks. InputError: too short, unevenly sampled, not a number.
  SegmentedRun prepare(const std::string& name, Recording recording) const;

  // Residuals of a run, rows x outputs, each over `sigma` of its output. Rows after the last whole segment do not
  // count.
  Eigen::MatrixXf residuals(const ModelChange& change, const SegmentedRun& run, const std::vector<double>& sigma) const;
  // The same until `enough(row, residuals)`, asked after every row, is true; what is not run is not written.
  using Enough = std::function<bool(std::size_t, const Eigen::MatrixXf&)>;
  Eigen::MatrixXf residuals(const ModelChange& change, const SegmentedRun& run, const std::vector<double>& sigma,
                            const Enough& enough) const;
  // d residuals / d start per standard error, one matrix per state that a channel shows.
  std::vector<Eigen::MatrixXf> start_columns(const ModelChange& change, const SegmentedRun& run,
                                             const std::vector<double>& sigma) const;
  // Projects the start states of one segment out of the columns [rows x outputs, stacked] in place.
  static void project(const Eigen::MatrixXd& starts, Eigen::MatrixXd& columns);
  // Rows of one segment as one column: outputs one after the other.
  Eigen::VectorXd stacked(const Eigen::MatrixXf& residuals, std::size_t first_row) const;

  const Datasheet& sheet() const { return sheet_; }
  std::size_t segment() const { return segment_; }
  const std::vector<int>& outputs() const { return outputs_; }  // channels that count
  // Standard deviation of each output's own noise in these runs: from third differences, never below rounding.
  std::vector<double> noise(const std::vector<SegmentedRun>& runs) const;
  // The same as the datasheet says it.
  const std::vector<double>& noise() const { return noise_; }

 private:
  Eigen::MatrixXf simulate(const ModelChange& change, const SegmentedRun& run, const std::vector<double>& starts,
                           const std::vector<double>& sigma, const Enough& enough = {}) const;

  Datasheet sheet_;
  std::size_t segment_;
  SegmentOptions options_;
  std::vector<int> outputs_;
  std::vector<double> noise_;
  std::vector<int> shown_by_;    // per state: channel that shows it, or -1
  std::vector<std::size_t> at_;  // per state: position of that channel among the outputs
};

}  // namespace faultline

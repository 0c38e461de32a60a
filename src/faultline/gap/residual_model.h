// Residuals of a driven model over recordings, by segments: an integrating plant cannot run free for long, so the states are put
// back to smoothed measurements every segment. What is left of the error in those start states is projected out: to first order the
// segment's loss is its marginal likelihood over the start state.
//
//   r = (y - y_model)/sigma,  loss = 1/2 sum r' (I + S C S')^-1 r     S: d r/d start state, C: covariance of the smoothed start
//
// sigma per channel is the recording's own noise (from third differences), never below rounding. Channels that are ground truth
// are not used, and commands that are ground truth count as 0.
#pragma once

#include <Eigen/Core>

#include "faultline/rig/simulator.h"

namespace faultline {

struct GapModel {
  std::vector<double> parameters;  // in the datasheet's order
  std::vector<EffectSpec> effects;
};

// One recording, prepared once.
struct GapRun {
  std::string name;
  Recording recording;                // ground truth removed
  std::vector<std::size_t> restarts;  // first row of each segment
  std::vector<double> start_states;   // segments x states; NaN where no channel shows the state
  std::vector<double> start_std;      // per state: standard error of the smoothed start
  std::size_t segments() const { return restarts.size(); }
};

class ResidualModel {
 public:
  // InputError where runs are not of this rig, too short, or not evenly sampled. `segment` in samples.
  ResidualModel(const Datasheet& sheet, std::vector<GapRun> runs, std::size_t segment);

  const Datasheet& sheet() const { return sheet_; }
  const std::vector<GapRun>& runs() const { return runs_; }
  const std::vector<int>& outputs() const { return outputs_; }  // channels that count
  const std::vector<double>& noise() const { return noise_; }   // per output, channel's unit
  std::size_t segment() const { return segment_; }

  // Normalised residuals of one run, rows x outputs. A model that leaves all bounds gives large but finite numbers.
  Eigen::MatrixXf residuals(const GapModel& model, std::size_t run) const;
  // The same with the states put back every `horizon` samples, and the first `horizon` rows after each counted.
  Eigen::MatrixXf residuals(const GapModel& model, std::size_t run, std::size_t horizon) const;
  // d residuals / d start states, by differences: one matrix per state that channels show.
  std::vector<Eigen::MatrixXf> start_sensitivity(const GapModel& model, std::size_t run) const;

 private:
  Eigen::MatrixXf simulate(const GapModel& model, const GapRun& run, const std::vector<std::size_t>& restarts,
                           const std::vector<double>& starts) const;

  Datasheet sheet_;
  std::vector<GapRun> runs_;
  std::size_t segment_;
  std::vector<int> outputs_;
  std::vector<double> noise_;
  std::vector<int> state_channel_;  // channel that shows a state, or -1
};

// Reads nothing: prepares a recording whose channels are the datasheet's, in order. `stride`: samples between restarts.
GapRun prepare_run(const Datasheet& sheet, const std::string& name, Recording recording, std::size_t segment);

// Standard deviation of the white noise on a signal, from its third differences (robust: median of magnitudes).
double noise_floor(const Recording& recording, std::size_t column);

}  // namespace faultline

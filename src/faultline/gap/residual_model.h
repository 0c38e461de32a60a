// Residuals of a driven model over recordings, by segments: an integrating plant cannot run free for long, so the
// states are put back every segment. The start states are estimated with everything else: they begin at smoothed
// measurements and are shifted by d (in units of their prior's standard deviation); what is left of their error is
// projected out, so that to first order a segment's loss is its marginal likelihood over the start state.
//
//   r = (y - y_model)/sigma,  loss = min over e of 1/2 |r + S e|^2 + 1/2 |d + e|^2   S: d r/d start state
//
// The prior is wider than the smoothing's error: a state that moves within the smoothing window is smoothed with a
// bias. sigma per channel is the recording's own noise (from third differences), never below rounding. Measured
// inputs that drive the model are smoothed as far as what is taken away is white: their noise would break a stuck
// body loose too early. Channels that are ground truth are not used, and commands that are ground truth count as 0.
#pragma once

#include <Eigen/Core>

#include "faultline/gap/gap_options.h"
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
  std::vector<double> start_std;      // per state: standard deviation of the prior of the start state
  std::vector<double> start_shift;    // segments x states: estimated less smoothed, in those deviations
  std::size_t segments() const { return restarts.size(); }
};

class ResidualModel {
 public:
  // InputError where runs are not of this rig, too short, or not evenly sampled. `segment` in samples.
  ResidualModel(const Datasheet& sheet, std::vector<GapRun> runs, std::size_t segment, const GapOptions& options = {});

  const Datasheet& sheet() const { return sheet_; }
  const std::vector<GapRun>& runs() const { return runs_; }
  const std::vector<int>& outputs() const { return outputs_; }  // channels that count
  const std::vector<double>& noise() const { return noise_; }   // per output, channel's unit
  std::size_t segment() const { return segment_; }
  const GapOptions& options() const { return options_; }  // of all that works with these residuals

  // Normalised residuals of one run, rows x outputs. A model that leaves all bounds gives large but finite numbers.
  Eigen::MatrixXf residuals(const GapModel& model, std::size_t run) const;
  // The same with the states put back every `horizon` samples, and the first `horizon` rows after each counted.
  Eigen::MatrixXf residuals(const GapModel& model, std::size_t run, std::size_t horizon) const;
  // d residuals / d start states (each in deviations of its prior), by differences: one matrix per state that
  // channels show.
  std::vector<Eigen::MatrixXf> start_sensitivity(const GapModel& model, std::size_t run) const;
  // Shifts of the start states that channels show, in deviations of their prior: segments x shown states.
  Eigen::MatrixXd start_shift(std::size_t run) const;
  // Moves the start states to those that fit the model best, where that lowers a segment's loss. One Gauss-Newton
  // step a call. Returns the sensitivities that it used: `known` ones, or its own where that is empty.
  std::vector<Eigen::MatrixXf> settle_starts(const GapModel& model, std::size_t run,
                                             std::vector<Eigen::MatrixXf> known = {});

 private:
  double start_at(const GapRun& run, std::size_t row, int channel) const;
  Eigen::MatrixXf simulate(const GapModel& model, const GapRun& run, const std::vector<std::size_t>& restarts,
                           const std::vector<double>& starts) const;
  void read_held_values(const GapModel& model, const GapRun& run, Eigen::MatrixXf& residuals) const;

  Datasheet sheet_;
  std::vector<GapRun> runs_;
  std::size_t segment_;
  GapOptions options_;
  std::vector<int> outputs_;
  std::vector<double> noise_;
  std::vector<int> state_channel_;  // channel that shows a state, or -1
};

// Reads nothing: prepares a recording whose channels are the datasheet's, in order. `stride`: samples between restarts.
GapRun prepare_run(const Datasheet& sheet, const std::string& name, Recording recording, std::size_t segment,
                   const GapOptions::Residuals& options = {});

// Smooths the recorded inputs (role input) in place; see above.
void smooth_inputs(const Datasheet& sheet, Recording& recording, const GapOptions::Residuals& options = {});

// Standard deviation of the white noise on a signal, from its third differences (robust: median of magnitudes).
double noise_floor(const Recording& recording, std::size_t column);

}  // namespace faultline

// One recording, cut into segments of equal length: an integrating plant cannot run free for long, so at the head of
// every segment the model's states are put back.
//
// What cannot be used is left out. A break in time (even_rows.h) ends a stretch, as does a command or measured input
// that is not a number; segments lie within stretches. Readings of outputs that are missing or at an end of their range
// (smoothing.h) do not count. A run has the period at which its samples come, which need not be the datasheet's.
// Channels that are ground truth are not used, and commands that are ground truth count as 0.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "faultline/rig/datasheet.h"
#include "faultline/segments/segment_options.h"
#include "faultline/signal/sample.h"

namespace faultline {

// Rows first .. last - 1 without a break that hold at least one segment, and after those what is too short for
// another.
struct Stretched {
  std::size_t first = 0, last = 0;
};

struct SegmentedRun {
  std::string name;
  Recording recording;                // channels in the datasheet's order, ground truth removed, inputs smoothed
  double period = 0;                  // s, between samples
  std::size_t segment = 0;            // rows of each
  std::vector<Stretched> stretches;   // in order of time
  std::vector<std::size_t> restarts;  // first row of each segment
  bool parted = false;                // segments are left out, and what lies between the others is not run
  std::size_t lead = 0;               // segments at the head of each stretch that only fill memories
  // What swings by itself is ahead of where it is in the first run: by the time s, by the angle of a shaft rad.
  double ahead = 0, turned = 0;
  std::vector<double> counted;                  // per segment: readings of outputs that count
  std::string remark;                           // what was left out and why; empty: nothing
  std::vector<std::vector<double>> unsmoothed;  // per channel, of inputs that are compared: as measured; else empty
  std::vector<double> input_noise;  // per channel, of a reading of measured inputs; 0: no input, or not smoothed
  // Where each segment starts: starts + start_roots start_shift, the shift beforehand normal with covariance 1
  // (segment_model.h). States x 1, states x directions, directions x 1; NaN: the state goes on.
  std::vector<Eigen::VectorXd> starts, start_shift;
  std::vector<Eigen::MatrixXd> start_roots;

  // What a compared channel shows at a row; and that row as it was measured.
  double reading(std::size_t row, std::size_t channel) const {
    return unsmoothed[channel].empty() ? recording.at(row, channel) : unsmoothed[channel][row];
  }
  Sample measured(std::size_t row) const;
  std::size_t segments() const { return restarts.size(); }
  double duration() const { return static_cast<double>(recording.rows()) * period; }  // s
};

// Channels that a model is held against: outputs, and inputs that it predicts from a command (what a drive makes of it
// shows there alone; the plant is driven by their readings all the same); none that is ground truth.
std::vector<int> compared_outputs(const Datasheet& sheet);

// InputError where no reading of a compared output says anything: all are missing, or at an end of their range.
void need_readings(const Datasheet& sheet, const std::vector<SegmentedRun>& runs);

// Cuts a recording whose channels are the datasheet's, in order, into segments of `segment` s. No starts yet.
// InputError where nothing is left. Inputs are smoothed where a run is long enough to tell their noise from motion; in
// short stretches how far would change from one to the next.
enum class Inputs { smoothed, as_measured };
SegmentedRun cut_run(const Datasheet& sheet, const std::string& name, Recording recording, double segment,
                     const SegmentOptions& options = {}, Inputs inputs = Inputs::smoothed);

// Samples on each side of a row, at most, that its inputs are smoothed over.
std::size_t widest_window(const SegmentedRun& run, const SegmentOptions& options);

// Rows of a segment in the run whose samples are slowest: where periods differ, a segment of any run counts as if it
// had so many readings, since those of a faster run hardly know more of the same stretch of motion.
std::size_t fewest_rows(const std::vector<SegmentedRun>& runs);

// The run with some of its segments (rising), starts and all.
SegmentedRun some_segments(const SegmentedRun& run, const std::vector<std::size_t>& which);

// The run in segments `times` as long, without starts; fewer than so many before a break are left out.
SegmentedRun joined_segments(const SegmentedRun& run, std::size_t times);

// The run with each of its segments cut into so many, without starts; rows at its end that make none are left out.
SegmentedRun shorter_segments(const Datasheet& sheet, const SegmentedRun& run, std::size_t times,
                              const SegmentOptions& options = {});

// Noise of each compared output over runs, in the channel's unit: their own (smoothing.h), never below what rounding
// takes away, by the datasheet or by the grid on which the readings lie (grid_step.h).
std::vector<double> noise_of(const Datasheet& sheet, const std::vector<SegmentedRun>& runs,
                             const SegmentOptions& options = {});
// What it is never below.
std::vector<double> least_noise_of(const Datasheet& sheet, const std::vector<SegmentedRun>& runs,
                                   const SegmentOptions& options = {});
// The same as the datasheet says it; and of any channel.
std::vector<double> noise_of(const Datasheet& sheet, const SegmentOptions& options = {});
double noise_of(const Channel& channel, const SegmentOptions& options = {});

}  // namespace faultline

// Are the channels of a recording what they are called, and is the datasheet this rig's? Before a fault is named, every
// reading of it that a person at the bench gets wrong is tried: one channel with its sign turned, two of one unit
// exchanged; a transducer that is stuck, though its noise goes on; and, of what was there from the beginning, one
// parameter far off its tolerance, as on another build.
//
//   L(reading) = sum over outputs and segments of ln(1 + mean square residual in noise variances)
//
// of the rig's model driven by that reading of a stretch, from the states that it shows. Logarithms, so that no channel
// hides the others. A reading is better where L per segment falls by `kGain` against the recording as it is and by
// `kLead` against the best fault: tolerances and faults leave L far above noise, but a wrong reading more so. It must
// not be worse by as much on what was recorded before the fault was seen: cables change places between runs. A reading
// out of range is none; what stands still tells nothing. A parameter that would have to be more than three times the
// datasheet's value, or less than a third, names nothing: the line then says that the model does not fit. A fault that
// does what a parameter does fits as well, and keeps its name.
// A transducer may be stuck where its readings stay within their noise though the model moves them. The model is then
// run without it, as of a rig that has no such transducer, and the readings are held against their mean. What a command
// drives may be stuck at anything that was commanded before, where the datasheet says that it can be stuck.
#pragma once

#include <string>

#include "faultline/estimators/stretch_model.h"

namespace faultline {

// Two channels exchanged, one with its sign turned (`one` and `other` are the same), one stuck, or one parameter
// `factor` times the datasheet's.
struct OtherReading {
  enum class Of { channels, stuck, parameter } of = Of::channels;
  std::size_t one = 0, other = 0;
  double held = 0;   // of a command that is stuck: in its unit
  double left = 0;   // L with that
  double since = 0;  // s, from when on `one` is stuck
  double lead = 0;   // of that over all else, in logarithms
  std::size_t parameter = 0;
  double factor = 1;
  std::string text;  // one line; empty: no reading
  bool is_stuck() const { return !text.empty() && of == Of::stuck; }
};

// Port of the transducer or the command that a reading says is stuck; empty: it says no such thing.
std::string stuck_port(const Datasheet& sheet, const OtherReading& reading);

// `lead` from which one stretch is enough to tell that a transducer is stuck: mean squares of one output by a factor of
// 55. With less the next must say the same.
constexpr double kSureLead = 4;

// Which reading of the stretch fits better than each of `faults`: ways in which what was found may explain it.
// `healthy`: the rig as it was known before. `change`: the fault came in the run. `before`: a stretch in which it was
// not seen; without rows where there is none.
OtherReading better_reading(const Datasheet& sheet, const StretchModel& model, const Stretch& stretch,
                            const std::vector<ModelPoint>& faults, const ModelPoint& healthy, bool change,
                            const Recording& before);

// Whether a stretch says of a reading that others had shown that one of `faults` is better by `kLead`, or of a command
// that it is not held where it was, whatever it is.
bool contradicts(const Datasheet& sheet, const StretchModel& model, const Stretch& stretch,
                 const std::vector<ModelPoint>& faults, const ModelPoint& healthy, const OtherReading& reading);

}  // namespace faultline

// What comes with samples: which rig they are of, and which channel in which unit stands where. Checked against the
// datasheet before a sample is believed.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "faultline/rig/datasheet.h"
#include "faultline/signal/sample.h"

namespace faultline {

struct Description {
  std::string rig;
  double sample_period = 0;        // s
  std::vector<std::string> names;  // of the channels, in the order of the values
  std::vector<std::string> units;
  std::string made_by;
  double start = 0;  // s, stamp of the run's first sample; 0: not known
};

// For every channel of the datasheet its place among the described ones. Throws InputError that names the wrong rig,
// the missing or doubled channel, or the unit that differs. Further channels are allowed and left out; the order may be
// any.
std::vector<std::size_t> match_channels(const Datasheet& sheet, const Description& description);

// Puts the values of `sample` into the datasheet's order, in place; false if there are not `described` of them.
bool arrange(const std::vector<std::size_t>& places, std::size_t described, Sample& sample);

Description describe(const Datasheet& sheet, const std::string& made_by);

}  // namespace faultline

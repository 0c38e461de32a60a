// What a rig's detectors and isolators say about one sample, and which of it is to be told. Dumb data: made by
// IsolationStage, read by AlarmKeeper; between nodes the messages Detections and Hypotheses carry it.
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "faultline/detectors/detector.h"
#include "faultline/estimators/estimate.h"
#include "faultline/isolation/isolator.h"
#include "faultline/isolation/reason.h"

namespace faultline {

struct DetectorResult {
  std::string name;  // in the datasheet, which also says what its detection means
  Detection detection;
  std::string size_name, size_unit;                            // known once it detected something
  double evidence = std::numeric_limits<double>::quiet_NaN();  // its criterion over the threshold; NaN: it has none
  Reason reason = Reason::absent;
  int takes_over = -1;  // the isolator whose alarm it goes on with, as that no longer finds what both had found
};

struct IsolatorResult {
  std::string name;  // in the datasheet
  Finding finding;
  Reason reason = Reason::absent;
  int detector = -1;  // that found the same; its words are used
};

struct Assessment {
  double time = 0;  // s
  std::uint64_t sequence = 0;
  std::vector<ChannelStatus> channel_status;  // one per channel of the rig
  bool judged = false;                        // something that would show a fault has judged so far
  double undecided_since = std::numeric_limits<double>::quiet_NaN();  // s, Isolator; NaN: nothing is
  bool quiet = false;  // for two samples no detector says anything or is blind; where it is not known: false
  std::vector<DetectorResult> detectors;  // in the datasheet's order
  std::vector<IsolatorResult> isolators;
};

}  // namespace faultline

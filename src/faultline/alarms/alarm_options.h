// What the alarm stage decides by, beside the settings of the rig's detectors and isolators.
#pragma once

#include <cstddef>

namespace faultline {

struct AlarmOptions {
  // A rig that gave no sample for max(shortest_stale_s, the lesser of stale_periods and of few_stale_periods +
  // person_stale_s) is silent. A hundred periods are far beyond the jitter of a DAQ; operating system and network may
  // hold samples of a fast rig back for 0.1 s without anything being wrong. Of a slow rig three samples say enough,
  // once a person would have noticed.
  double stale_periods = 100;
  double few_stale_periods = 3;
  double person_stale_s = 1;
  double shortest_stale_s = 0.1;

  // Kept in the report; beyond that an ended alarm gives way. Bounds the memory of a node that runs for months and the
  // size of its message, which holds them all; more than anybody reads.
  std::size_t most_alarms = 1000;
};

}  // namespace faultline

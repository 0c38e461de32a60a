// What may be wrong with a rig: every effect at every port of its datasheet, each of one unknown size.
//
// The size is counted as an amplitude a: the parameter is none + a (full - none), or full/a where its no-effect value is infinite (as
// effects grow, rig/effect.h). Other parameters that would change something stay at their no-effect values; shapes stand in the middle
// of their range. Effects that have no size (stuck) or change no mean (noise, quantisation) are left to detectors.
#pragma once

#include <string>
#include <vector>

#include "faultline/rig/alarm_kind.h"
#include "faultline/rig/datasheet.h"
#include "faultline/rig/effect.h"

namespace faultline {

struct FaultHypothesis {
  std::string effect, port, family;
  AlarmKind kind = AlarmKind::fault;  // or sensor
  std::string size_name, size_unit;   // of the parameter that is the size
  std::size_t parameter = 0;          // its place in the effect's list
  EffectSpec full;                    // at amplitude 1
  double none = 0;
  double lowest = 0, highest = 0;  // amplitudes that the datasheet's bounds allow
  double probe = 1;                // a small amplitude, for differences

  std::string name() const { return effect + "@" + port; }
  EffectSpec at(double amplitude) const;
  double size(double amplitude) const;  // in size_unit
};

std::vector<FaultHypothesis> fault_hypotheses(const Datasheet& sheet);

}  // namespace faultline

// A step of a rig that is taken only where no event falls into it: its motion() begins and ends the same.
#pragma once

#include <algorithm>
#include <vector>

#include "faultline/rig/rig.h"

namespace faultline {

// Whether it was; else state and modes are as before. `state`: what `step` moves; `before`: room for as many values.
// `wanted`: the motion in which it may begin; Rig::kUneven: in any but that.
template <class Step>
bool without_event(Rig& rig, double* state, std::vector<double>& before, int wanted, Step&& step) {
  const int motion = rig.motion(state);
  if (motion == Rig::kUneven || (wanted != Rig::kUneven && motion != wanted)) return false;
  std::copy_n(state, before.size(), before.begin());
  step();
  if (rig.motion(state) == motion) return true;
  std::copy_n(before.begin(), before.size(), state);
  rig.set_modes(state);
  return false;
}

}  // namespace faultline

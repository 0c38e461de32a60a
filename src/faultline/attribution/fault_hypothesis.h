// What may be wrong with a rig: every candidate (candidates.h) with each of its sizes as the one that is unknown.
//
// The size is counted as an amplitude a: the parameter is none + a (full - none), or full/a where its no-effect value
// is infinite (as effects grow, rig/effect.h). Other parameters that would change something stay at their no-effect
// values; shapes stand in the middle of their range. Effects that have no size (stuck) or change no mean (noise,
// quantisation) are left to detectors.
#pragma once

#include <string>
#include <vector>

#include "faultline/rig/alarm_kind.h"
#include "faultline/rig/datasheet.h"
#include "faultline/rig/effect.h"

namespace faultline {

// The size of an effect at amplitude a, see above.
double effect_size(double none, double full, double amplitude);
// All sizes of an effect, `full` at amplitude 1; shapes stay.
std::vector<double> scaled(const EffectSpec& full, double amplitude);

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

// Amplitudes; units as in gap/gap_options.h.
struct HypothesisOptions {
  double logarithmic_ratio = 5;  // of a range's bounds, from which its middle is the geometric one
  double small_amplitude =
      0.1;  // of a size with a range on both sides of no effect, for differences: within the linear part
  double least_amplitude_ratio =
      1e-3;                // of the least change to the largest, of a size whose no-effect value is infinite
  double open_ratio = 10;  // to its least value, of the full size of such a range that has no end
};

std::vector<FaultHypothesis> fault_hypotheses(const Datasheet& sheet, const HypothesisOptions& options = {});

}  // namespace faultline

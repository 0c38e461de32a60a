// What a simulator makes of a measured input when no recording gives it: its level through lags, plus band-limited
// wander (a sum of sines with random phases, spread evenly over the logarithm of frequency), less the droop of the flow
// that is drawn, through a lag of its own. Units: the channel's; droop in that unit per m^3/s.
#pragma once

#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "faultline/rig/datasheet.h"
#include "faultline/rig/excitation.h"

namespace faultline {

class InputSource {
 public:
  InputSource(const InputSignal& signal, const InputLevel& level, std::uint64_t seed, double period);

  bool droops() const { return droop_ > 0; }
  void settle(double drawn) { drawn_ = drawn; }  // at the start: as if it had been drawn for long
  // To be called once per sample, with rising times; `drawn`: m^3/s over the sample period before, unless at the start.
  double value(double time, double drawn);

 private:
  double value_, amplitude_ = 0, droop_, lag_share_, droop_share_, drawn_ = 0;
  std::vector<double> lags_;
  std::unique_ptr<Excitation> moves_;
  std::vector<std::pair<double, double>> tones_;  // Hz, rad
};

}  // namespace faultline

// The low-pass filter before a signal is sampled at a longer period T than it was measured at: what lies above half the
// new rate would come back as a slow motion that was never there.
//
//   y(t) = sum_i w_i h(t - t_i) x_i / sum_i w_i h(t - t_i),   |t - t_i| <= 8 T
//   h(tau) = sinc(2 f_c tau) I0(5 sqrt(1 - (tau/8T)^2)) / I0(5),   f_c = 0.4/T,   w_i = (t_i+1 - t_i-1)/2
// A windowed-sinc FIR low-pass with a Kaiser window (Oppenheim, Schafer, Discrete-Time Signal Processing, section 7.5:
// beta 5.0 and a length of 16 T give a stop band of 54 dB from 0.5/T on and a pass band up to 0.3/T; half amplitude at
// f_c). It is symmetric: nothing is delayed, so that measured values stay where they are against commands, which a
// model would take for a lag. Weights w_i: samples need not be even. Constants pass unchanged. Units: s, Hz.
// Needs samples 8 T before and behind t; fails to stop what the measurement itself folded already.
#pragma once

#include <string>
#include <vector>

namespace faultline {

class AntiAlias {
 public:
  explicit AntiAlias(double period);  // T [s]
  double reach() const { return reach_; }
  double corner() const { return corner_; }
  double weight(double tau) const;  // h
  // With its order on samples `period` apart: "windowed-sinc FIR low-pass (Kaiser 5.0, order 160, 0.4 Hz, ...)".
  std::string describe(double period) const;

 private:
  double reach_, corner_;
  std::vector<double> table_;  // h over 0 to reach: the Bessel function costs more than all else together
};

}  // namespace faultline

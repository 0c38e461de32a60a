// Low-pass filter of second order, Butterworth, causal: the bilinear transform of
//
//   H(s) = w^2 / (s^2 + sqrt(2) w s + w^2),   w = 2/T tan(pi f T)
//
// so that the amplitude at the cut-off f is 1/sqrt(2) exactly (Oppenheim, Schafer, Discrete-Time Signal Processing,
// section 7.1). Units: Hz, s. Slow signals come out late by lag() = sqrt(2)/w: 15 ms at 15 Hz. A step allocates
// nothing.
#pragma once

namespace faultline {

class Butterworth {
 public:
  // InputError unless 0 < cut_off < 0.5/period.
  Butterworth(double cut_off, double period);
  // As if the signal had always been `value`.
  void start(double value);
  double step(double value);
  double lag() const { return lag_; }

 private:
  double b0_, a1_, a2_, lag_;  // numerator b0 (1 + z^-1)^2
  double first_ = 0, second_ = 0;
};

}  // namespace faultline

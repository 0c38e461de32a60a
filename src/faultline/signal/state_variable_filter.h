// State variable filter: one low-pass for several signals, which gives each of them, filtered, and its derivatives.
// Sources: Yu, Control Engineering Practice 5 (1997), equations (4)-(10); Peter, Isermann, IFAC symposium on adaptive
// systems (1989).
//
//   X_F(s) = (w/(s + w))^n X(s)      n poles at -w, critically damped
//   z = [x_F, x_F', ..., x_F^(n-1)],   z' = A z + b x                                              (4), (5)
//   z_k = e^(A T) z_k-1 + integral from t_k-1 to t_k of e^(A (t_k - t)) b p(t) dt                   (6), (9)
// Filters that are alike leave a linear differential equation between the signals as it is, so it holds between their
// x_F^(i) too. Between samples the signal is taken for a polynomial p of order r: 0 holds the sample before, which
// delays by half a period; 1 to 3 run through the latest sample and the r before it. Only samples that are there
// already are used, so 1 to 3 delay nothing. The step is exact for such a p, whatever w T: with c the derivatives of p
// at t_k-1, d/dt [z; c] = [A b 0; 0 shift] [z; c], whose matrix exponential has both factors. (10) as printed lacks
// i = 0, and its recursion from A^-1 loses digits where w T is small.
//
// Samples may be uneven: the step follows the times given, and the matrices are made anew where a step differs from the
// last by more than 1e-4 of itself (stamps of Unix time in doubles are rounded to 0.24 us). Until r samples are there
// the order is lower. A filter begins as if the signals had always been what they are then; what is wrong in that dies
// away as (w t)^(n-1) e^(-w t). After a hole in the samples begin anew: no polynomial bridges what it cannot see.
// Units: s, rad/s; a derivative is in the signal's unit per s^i. A step allocates nothing.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace faultline {

class StateVariableFilter {
 public:
  static constexpr int kMaximumOrder = 4, kMaximumInterpolation = 3;

  // `order` n of 1 to 4, `bandwidth` w in rad/s above 0, `interpolation` r of 0 to 3; else throws InputError.
  StateVariableFilter(int order, double bandwidth, int interpolation, std::size_t signals);

  void reset(const double* signals);
  // To the sample `dt` s after the last, dt > 0.
  void step(const double* signals, double dt);
  // x_F^(derivative) of a signal at the last sample; derivatives from 0 to order - 1.
  double value(std::size_t signal, int derivative) const {
    return state_[signal].z[static_cast<std::size_t>(derivative)] * power_[static_cast<std::size_t>(derivative)];
  }

 private:
  static constexpr std::size_t kStates = kMaximumOrder, kSamples = kMaximumInterpolation + 1;
  struct Signal {
    std::array<double, kStates> z{};   // x_F^(i)/w^i: numbers of one size
    std::array<double, kSamples> x{};  // samples, the latest first
  };
  void make_step();

  std::size_t n_, r_;
  double bandwidth_;
  std::array<double, kStates> power_{};              // w^i
  std::array<double, kSamples - 1> spacing_{};       // s, from each sample to the one before it, the latest first
  std::array<double, kSamples - 1> made_for_{};      // spacings of the matrices below
  std::size_t before_ = 0, made_before_ = 0;         // samples before the latest, as far as used
  std::array<double, kStates * kStates> carry_{};    // of z
  std::array<double, kStates * kSamples> weight_{};  // of the samples
  std::vector<Signal> state_;
};

}  // namespace faultline

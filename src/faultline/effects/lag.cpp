// Lag: (1 + (1 - s) T d/dt)(1 + s T d/dt) y = u, T = time_constant, s = second: one low pass, or two in a row.
//
// time_constant [s]: by how much y is late where u moves evenly. second [1], a shape: the share of it that a second low
// pass has (a transducer and the filter behind it); 0 is a first-order lag. Each low pass, of time constant t, is
// discretised exactly for an input that runs straight from one step h to the next, e = exp(-h/t):
//   y += (1 - e)(u_before - y) + (1 - (1 - e) t/h)(u - u_before)
// so that the lag of a signal that moves is the time constant, however short. y starts at the first value (no start-up
// transient). Continuous in time_constant down to 0, where y = u. Undone as u = y + T y' + s (1 - s) T^2 y'', y'' from
// the slopes around.

#include <algorithm>
#include <cmath>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class LowPass {
 public:
  void set(double time_constant, double step) {
    if (time_constant <= 0) {
      held_ = straight_ = 1;
      return;
    }
    const double steps = step / time_constant;
    held_ = -std::expm1(-steps);
    straight_ = steps > 1e-4 ? 1 - held_ / steps : steps / 2 - steps * steps / 6;
  }
  void start(double in, double out) {
    before_ = in;
    state_ = out;
  }
  double next(double value) {
    state_ += held_ * (before_ - state_) + straight_ * (value - before_);
    before_ = value;
    return state_;
  }

 private:
  double held_ = 1, straight_ = 1;  // shares of the step before and of the way since
  double state_ = 0, before_ = 0;
};

class Lag : public Effect {
 public:
  void reset() override { started_ = false; }

  double signal(double value, double /*time*/) override {
    if (!started_) {
      first_.start(value, value);
      second_.start(value, value);
      started_ = true;
      return value;
    }
    const double between = first_.next(value);
    return two() ? second_.next(between) : between;
  }
  Shown undo(const Course& out, double later, double /*time*/, double /*own*/) const override {
    Shown in = out(later);
    in.value += parameter(0) * in.slope;
    in.std = std::hypot(in.std, parameter(0) * in.slope_std);
    if (!two()) return in;
    const double apart = std::max(context().step, kApart * parameter(0));
    const double bend = (out(later + apart).slope - out(later - apart).slope) / (2 * apart);
    const double by = parameter(1) * (1 - parameter(1)) * parameter(0) * parameter(0);
    if (!std::isfinite(bend)) return in;
    in.value += by * bend;
    in.std = std::hypot(in.std, by * in.slope_std / (std::sqrt(2.0) * apart));
    return in;
  }
  bool remembers() const override { return true; }
  bool resumes_by_values() const override { return true; }
  void resume(const Shown& in, const Shown& out) override {
    // As where both move evenly, for a slope is not always known.
    const double between = out.value + parameter(1) * (in.value - out.value);
    first_.start(in.value, between);
    second_.start(between, out.value);
    started_ = true;
  }

 private:
  static constexpr double kApart = 0.3;  // of the time constant, for the second slope

  bool two() const { return parameter(1) > 0 && parameter(0) > 0; }

  void parameters_changed() override {
    first_.set((1 - parameter(1)) * parameter(0), context().step);
    second_.set(parameter(1) * parameter(0), context().step);
  }

  LowPass first_, second_;
  bool started_ = false;
};

}  // namespace

FAULTLINE_EFFECT(lag, {"lag",
                       "lag",
                       "y + time_constant y' + second (1 - second) time_constant^2 y'' = u",
                       {PortKind::command, PortKind::sensor},
                       {{"time_constant", "s", 0, 0, 1e6}, {"second", "1", kNoShape, 0, 0.5, 0}},
                       &make_effect<Lag>});

}  // namespace faultline

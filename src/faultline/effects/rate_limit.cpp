// Rate limit: |dy/dt| <= rate; y follows u at the largest slope allowed and meets it again.
//
// rate [of what passes, per second]; infinite: none. Starts at the first value. Continuous in u and, as 1/size, down to
// no effect. Undone as it stands where it moves slower; else what a model has, if that lies ahead. Event-driven (a kink
// where y meets u). Limit: the same bound up and down.

#include <cmath>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class RateLimit : public Effect {
 public:
  void reset() override { started_ = false; }

  double signal(double value, double /*time*/) override {
    const double change = value - last_;
    if (!started_ || std::fabs(change) <= largest_change_)
      last_ = value;
    else
      last_ += std::copysign(largest_change_, change);
    started_ = true;
    return last_;
  }
  Shown undo(const Course& out, double later, double /*time*/, double own) const override {
    Shown in = out(later);
    const bool limited = std::fabs(in.slope) > kNearly * parameter(0) && (own - in.value) * in.slope > 0;
    if (limited) in.value = own;
    return in;
  }
  bool remembers() const override { return true; }
  bool resumes_by_values() const override { return true; }
  void resume(const Shown& /*in*/, const Shown& out) override {
    last_ = out.value;
    started_ = true;
  }

 private:
  static constexpr double kNearly = 0.9;  // of the rate, in a slope that has noise

  void parameters_changed() override { largest_change_ = parameter(0) * context().step; }

  double largest_change_ = kInfinity;
  double last_ = 0;
  bool started_ = false;
};

}  // namespace

FAULTLINE_EFFECT(rate_limit, {"rate_limit",
                              "limit",
                              "u, with |du/dt| bounded to rate",
                              {PortKind::command, PortKind::sensor},
                              {{"rate", "port/s", kInfinity, 1e-12, kInfinity}},
                              &make_effect<RateLimit>});

}  // namespace faultline

// Delay: y(t) = u(t - time), a pure transport delay.
//
// time [s]. Past values lie in a ring, one per step; between them y is interpolated linearly, so y is continuous in
// `time` and a delay below one step works too. Before the first value y is the first value. Memory is taken for the
// full-size delay when the effect is configured, none while it runs. Limit: interpolation smooths what is faster than
// the step; at most 1e4 s, of which each step is kept.
// Undone by what comes out `time` later. What is on its way stays; at a start it is taken to have run straight, for the
// readings to come are what a model is held against.

#include <algorithm>
#include <cstddef>
#include <vector>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class Delay : public Effect {
 public:
  void reset() override {
    past_.assign(needed_, 0);
    newest_ = 0;
    started_ = false;
    place();
  }

  double signal(double value, double /*time*/) override {
    if (!started_) std::fill(past_.begin(), past_.end(), value);
    started_ = true;
    newest_ = newest_ + 1 == past_.size() ? 0 : newest_ + 1;
    past_[newest_] = value;
    const std::size_t later = newest_ >= whole_ ? newest_ - whole_ : newest_ + past_.size() - whole_;
    const std::size_t earlier = later == 0 ? past_.size() - 1 : later - 1;
    return past_[later] + fraction_ * (past_[earlier] - past_[later]);
  }
  Shown undo(const Course& out, double later, double /*time*/, double /*own*/) const override {
    return out(later + parameter(0));
  }
  bool remembers() const override { return true; }
  void resume(const Shown& in, const Shown& /*out*/) override {
    if (started_) return;
    for (std::size_t i = 0; i < past_.size(); ++i)
      past_[newest_ >= i ? newest_ - i : newest_ + past_.size() - i] =
          in.value - in.slope * context().step * static_cast<double>(i);
    started_ = true;
  }

 private:
  void parameters_changed() override {
    steps_ = std::max(0.0, parameter(0) / context().step);
    if (size() >= 1) needed_ = std::max(needed_, static_cast<std::size_t>(steps_) + 2);
    place();
  }

  // Where in the ring the delayed value lies. A ring that is too short (before reset) holds the longest it can.
  void place() {
    const double longest = past_.size() < 2 ? 0 : static_cast<double>(past_.size() - 2);
    whole_ = static_cast<std::size_t>(std::min(steps_, longest));
    fraction_ = std::min(1.0, steps_ - static_cast<double>(whole_));
  }

  double steps_ = 0;        // delay in steps
  std::size_t needed_ = 2;  // entries of the ring
  std::size_t whole_ = 0;
  double fraction_ = 0;
  std::vector<double> past_ = std::vector<double>(2, 0.0);
  std::size_t newest_ = 0;
  bool started_ = false;
};

}  // namespace

FAULTLINE_EFFECT(delay, {"delay",
                         "delay",
                         "u(t - time)",
                         {PortKind::command, PortKind::sensor},
                         {{"time", "s", 0, 0, 1e4}},
                         &make_effect<Delay>});

}  // namespace faultline

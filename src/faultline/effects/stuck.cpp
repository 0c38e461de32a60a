// Stuck: from the time `from` on, y keeps its last value before it (the first value if there was none).
//
// from [s]; infinite: never. This is the effect's own parameter, not the time from which other effects grow, so a stuck
// channel does not grow. Reaches no effect as 1/size where from > 0. Limit: sticks for good, does not come back.

#include <cmath>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class Stuck : public Effect {
 public:
  void reset() override { started_ = false; }

  double signal(double value, double time) override {
    if (!started_ || time < parameter(0)) held_ = value;
    started_ = true;
    return held_;
  }
  double undo_signal(double value, double time) const override { return time < parameter(0) ? value : std::nan(""); }
  bool remembers() const override { return true; }

 private:
  double held_ = 0;
  bool started_ = false;
};

}  // namespace

FAULTLINE_EFFECT(stuck, {"stuck",
                         "stuck",
                         "u(from), from that time on",
                         {PortKind::command, PortKind::sensor},
                         {{"from", "s", kInfinity, 0, kInfinity}},
                         &make_effect<Stuck>});

}  // namespace faultline

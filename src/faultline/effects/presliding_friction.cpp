// Presliding friction: of a body's dry friction `force` is carried by bristles, which yield before they slip,
//   F = force z,  dz/dx = (1 - z sgn v) stiffness/force,  |z| <= 1                                     (Dahl's model)
// and the set-valued levels fall by `force`, the rig cutting them at 0: up to its own dry friction a body keeps its
// level at speed and moves like a spring before it breaks away; what `force` has beyond that adds to the level.
// Source: P. R. Dahl, "A solid friction model", 1968; as LuGre's without Stribeck part and bristle damping.
//
// force [N or N m]: level that bristles carry. stiffness [N/m or N m/rad], a shape: of the bristles at rest; infinite
// would be Coulomb's law. Continuous in x; takes energy out over every closed cycle.
// Exact whatever the step: since the last turn at x_t, z = sgn v + (z_t - sgn v) exp(-stiffness |x - x_t|/force), a
// function of the position alone, so that trial steps of an integrator retrace it; a turn is where the speed changes
// sign. A position that moved further than its speeds allow was put back (a segment's start) and moves no bristle.
// Limits: the port must pass position and speed; the rig's step must follow sqrt(stiffness/mass) (an explicit one:
// below 2.7 over it); no creep, no Stribeck part.

#include <algorithm>
#include <cmath>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class PreslidingFriction : public Effect {
 public:
  void reset() override { started_ = false; }
  bool remembers() const override { return true; }

  void force(const Motion& motion, BodyForces& sum) const override {
    if (!motion.rubs) return;
    follow(motion);
    sum.viscous += parameter(0) * wound(motion.position);
    sum.sliding_plus -= parameter(0);
    sum.sliding_minus -= parameter(0);
    sum.breakaway_plus -= parameter(0);
    sum.breakaway_minus -= parameter(0);
  }

 private:
  static constexpr double kReach = 2;  // times the way that the speeds before and after allow in a step

  void parameters_changed() override { per_metre_ = parameter(0) > 0 ? parameter(1) / parameter(0) : 0; }

  double wound(double position) const {
    const double way = std::max(0.0, direction_ * (position - turn_));
    return direction_ + (turn_wound_ - direction_) * std::exp(-per_metre_ * way);
  }

  void follow(const Motion& motion) const {
    if (!started_) {
      turn_ = last_ = motion.position;
      turn_wound_ = last_speed_ = 0;
      direction_ = motion.velocity < 0 ? -1 : 1;
      started_ = true;
    }
    const double speed = std::max(std::fabs(motion.velocity), std::fabs(last_speed_));
    const double moved = motion.position - last_;
    if (std::fabs(moved) > kReach * speed * context().step) {
      turn_ += moved;
      last_ += moved;
    }
    if (motion.velocity * direction_ < 0) {
      const double furthest = direction_ * std::max(direction_ * last_, direction_ * motion.position);
      turn_wound_ = wound(furthest);
      turn_ = furthest;
      direction_ = -direction_;
    }
    last_ = motion.position;
    last_speed_ = motion.velocity;
  }

  double per_metre_ = 0;
  mutable double turn_ = 0, turn_wound_ = 0, direction_ = 1;  // where the body turned last, how wound up, where to
  mutable double last_ = 0, last_speed_ = 0;
  mutable bool started_ = false;
};

}  // namespace

FAULTLINE_EFFECT(presliding_friction,
                 {"presliding_friction",
                  "friction",
                  "-force z, dz/dx = (1 - z sgn(v)) stiffness/force, in place of so much of the dry friction",
                  {PortKind::force},
                  {{"force", "N or N m", 0, 0, 1e6}, {"stiffness", "N/m or N m/rad", kNoShape, 1, 1e12}},
                  &make_effect<PreslidingFriction>});

}  // namespace faultline

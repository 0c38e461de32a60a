// Free curve: what passes a port, plus or times a tabulated function of what the port sees.
//
// Enters as a free signal does (free_signal.cpp), with the value c(x), straight between nine ordinates v0 .. v8 over
// low .. high (rig/curve_grid.h says where) and constant beyond. x is the quantity `of` of those that pass (0, 1, 2, in
// the order of passing() in rig/port.h), the first where there are fewer. Linear in the ordinates; at a sensor undone
// where x + c(x) rises. No rig is said to have it: it is how `faultline gap --adopt` takes in what no effect of the
// library resembles. A curve has no memory: friction that sticks becomes a steep slope, on which a body creeps.

#include "faultline/rig/curve_grid.h"
#include "faultline/rig/effect.h"

namespace faultline {
namespace {

constexpr int kFirstOrdinate = 3;

class FreeCurve : public Effect {
 public:
  double signal(double value, double /*time*/) override { return value + at(value); }
  double undo_signal(double value, double /*time*/) const override { return grid_.undo(values_, value); }
  double boundary(double value, double flow, double /*time*/) const override { return value + at(value, flow); }
  void force(const Motion& motion, BodyForces& forces) const override {
    forces.applied += at(motion.position, motion.velocity, motion.load);
  }
  double flow(const LeakPath& path) const override { return at(path.pressure_drop, path.upstream, path.shaft_speed); }
  double opening(double opening) const override { return opening * (1 + at(opening)); }
  double bulk_modulus(double modulus, double absolute_pressure) const override {
    return modulus * (1 + at(absolute_pressure));
  }
  double delivery(double flow, double shaft_angle) const override { return flow * (1 + at(flow, shaft_angle)); }

 private:
  double at(double first) const { return grid_.value(values_, first); }
  double at(double first, double second) const { return at(of_ == 1 ? second : first); }
  double at(double first, double second, double third) const { return at(of_ == 2 ? third : first, second); }

  void parameters_changed() override {
    of_ = static_cast<int>(parameter(0) + 0.5);
    grid_ = CurveGrid(parameter(1), parameter(2));
    for (std::size_t j = 0; j < kCurveNodes; ++j) values_[j] = parameter(kFirstOrdinate + static_cast<int>(j));
  }

  int of_ = 0;
  CurveGrid grid_;
  CurveValues values_{};
};

}  // namespace

FAULTLINE_EFFECT(free_curve,
                 {"free_curve",
                  "free",
                  "u + c(x), or u (1 + c(x)) as free_signal; x: what passes as number `of`; c: v0, v1, v2, v3, v4, v5, "
                  "v6, v7, v8 from low to high",
                  {PortKind::command, PortKind::sensor, PortKind::force, PortKind::flow, PortKind::restriction,
                   PortKind::compliance, PortKind::source},
                  {{"of", "1", kNoShape, 0, 2},
                   {"low", "passing", kNoShape, -1e12, 1e12},
                   {"high", "passing", kNoShape, -1e12, 1e12},
                   {"v0", "port", 0, -1e12, 1e12},
                   {"v1", "port", 0, -1e12, 1e12},
                   {"v2", "port", 0, -1e12, 1e12},
                   {"v3", "port", 0, -1e12, 1e12},
                   {"v4", "port", 0, -1e12, 1e12},
                   {"v5", "port", 0, -1e12, 1e12},
                   {"v6", "port", 0, -1e12, 1e12},
                   {"v7", "port", 0, -1e12, 1e12},
                   {"v8", "port", 0, -1e12, 1e12}},
                  &make_effect<FreeCurve>});

}  // namespace faultline

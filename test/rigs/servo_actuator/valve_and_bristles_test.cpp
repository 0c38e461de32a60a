// Effects with a part of their own in the equations of the servo actuator: a valve's underlap, whose edges are both
// open about zero, and bristles in place of set-valued friction.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "faultline/numerics/integrator.h"
#include "faultline/rig/rig.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

enum { kPosition, kVelocity, kPressureA, kPressureB, kSpool };
constexpr double kStep = 0.25e-3;

struct Actuator {
  explicit Actuator(const std::string& effect)
      : effects(servo(), effect.empty() ? std::vector<EffectSpec>{} : std::vector<EffectSpec>{parse_effect(effect)},
                kStep, 1),
        rig(find_rig_type("servo_actuator")->make(servo(), servo().nominal(), effects)),
        integrator(make_integrator(*rig)),
        channels(servo().channels.size()) {
    channels[column("supply_pressure")] = 6.89e6;
    rig->start(channels.data(), integrator->state());
  }
  double value(const char* parameter) const {
    return servo().parameters[static_cast<std::size_t>(servo().parameter(parameter))].nominal;
  }
  EffectSet effects;
  std::unique_ptr<Rig> rig;
  std::unique_ptr<Integrator> integrator;
  std::vector<double> channels;
};

TEST(ServoUnderlap, HasTheNullLeakageOfTwoOpenEdges) {
  Actuator actuator("underlap@restriction.valve:width=0.4");
  double* state = actuator.integrator->state();
  state[kPressureA] = 5e6;
  state[kPressureB] = 2e6;
  const double per_flow = 1 / (2 * actuator.value("compliance"));  // beta/V_0
  const double gain = actuator.value("flow_coefficient") * std::sqrt(2.0);
  std::vector<double> rate(static_cast<std::size_t>(actuator.rig->states()));
  for (const double spool : {-0.3, -0.1, 0.0, 0.15, 0.5}) {
    state[kSpool] = spool;
    actuator.rig->derivative(0, state, actuator.channels.data(), rate.data());
    const double ahead = gain * std::max(0.0, 0.2 + spool), astern = gain * std::max(0.0, 0.2 - spool);
    const double in_a = ahead * std::sqrt(1.89e6) - astern * std::sqrt(5e6);
    const double out_b = ahead * std::sqrt(2e6) - astern * std::sqrt(4.89e6);
    EXPECT_NEAR(rate[kPressureA], per_flow * in_a, 1e-6 * per_flow * gain * std::sqrt(5e6)) << spool;
    EXPECT_NEAR(rate[kPressureB], -per_flow * out_b, 1e-6 * per_flow * gain * std::sqrt(5e6)) << spool;
  }
}

// Towards half the supply, to first order in what they differ: p' = -gain width/2 per_flow/sqrt(P/2) p.
TEST(ServoUnderlap, ChambersThatDifferMeetWhereTheSpoolIsCentred) {
  for (const double width : {0.4, 0.0}) {
    Actuator actuator("underlap@restriction.valve:width=" + std::to_string(width));
    double* state = actuator.integrator->state();
    state[kPressureA] += 2e5;  // less than friction holds
    const int steps = 8000;
    for (int k = 0; k < steps; ++k) actuator.integrator->step(k * kStep, kStep, actuator.channels.data());
    const double rate = actuator.value("flow_coefficient") * std::sqrt(2.0) * width / 2 /
                        (2 * actuator.value("compliance")) / std::sqrt(3.445e6);
    const double left = 2e5 * std::exp(-rate * steps * kStep);
    EXPECT_NEAR(state[kPressureA] - 3.445e6, left, 0.01 * left) << width;
  }
}

// A load wound up slowly against closed chambers: the piston yields by the bristles' law and the oil's stiffness.
TEST(ServoBristles, YieldBeforeTheySlip) {
  const double force = 450, stiffness = 2e6, load = 300;
  for (const double step : {kStep, 2 * kStep}) {
    Actuator actuator("presliding_friction@force.piston:force=450,stiffness=2e6");
    double* state = actuator.integrator->state();
    for (int k = 0; k * step < 2; ++k) {
      actuator.channels[column("load_force")] = load * std::min(1.0, k * step);
      actuator.integrator->step(k * step, step, actuator.channels.data());
    }
    const double area = actuator.value("ram_area");
    const double oil = area * area / actuator.value("compliance");  // N/m, of both chambers: 2 beta A^2/V_0
    double low = 0, high = 1e-3;
    for (int i = 0; i < 60; ++i) {
      const double x = 0.5 * (low + high);
      (force * (1 - std::exp(-stiffness * x / force)) + oil * x < load ? low : high) = x;
    }
    EXPECT_NEAR(state[kPosition], -low, 0.01 * low);
    EXPECT_GT(low, 1e-4);
  }
  Actuator stuck("");  // set-valued friction holds it
  stuck.channels[column("load_force")] = load;
  for (int k = 0; k < 4000; ++k) stuck.integrator->step(k * kStep, kStep, stuck.channels.data());
  EXPECT_EQ(stuck.integrator->state()[kPosition], 0);
}

}  // namespace
}  // namespace faultline

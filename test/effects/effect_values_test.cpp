// Each effect at a number worked out by hand.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "effect_probe.h"
#include "faultline/rig/effect_chain.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

std::unique_ptr<Effect> effect_of(const std::string& text, double step = 1e-3, double range = 1,
                                  double start = kNoShape, std::uint64_t seed = 1) {
  const EffectSpec spec = parse_effect(text);
  const EffectType& type = *find_effect_type(spec.effect);
  std::vector<double> none;
  for (const auto& p : type.parameters) none.push_back(p.none);
  PortContext context;
  context.range = range;
  context.step = step;
  context.start = start;
  context.seed = seed;
  auto effect = type.make();
  effect->configure(spec.parameters, none, context);
  return effect;
}

BodyForces force_of(const std::string& text, const Motion& motion) {
  BodyForces sum;
  effect_of(text)->force(motion, sum);
  return sum;
}

TEST(EffectValues, CoulombFriction) {
  const auto f = force_of("coulomb_friction@force.a:force=40", {0, 0.1, 0});
  EXPECT_EQ(f.sliding_plus, 40);
  EXPECT_EQ(f.sliding_minus, 40);
  EXPECT_EQ(f.breakaway_plus, 40);
  EXPECT_EQ(f.breakaway_minus, 40);
  EXPECT_EQ(f.viscous, 0);
}

TEST(EffectValues, ViscousFriction) {
  EXPECT_DOUBLE_EQ(force_of("viscous_friction@force.a:coefficient=200", {0, -0.5, 0}).viscous, -100);
}

// The step response of two low passes in a row, 1 - (a exp(-t/a) - b exp(-t/b))/(a - b).
TEST(EffectValues, LagOfTwoLowPasses) {
  const double step = 1e-4, a = 0.06, b = 0.02;
  const auto lag = effect_of("lag@sensor.a:time_constant=0.08,second=0.25", step);
  lag->signal(0, 0);
  for (int k = 1; k <= 2000; ++k) {
    const double y = lag->signal(1, k * step), t = (k - 0.5) * step;  // the input rises over the first step
    EXPECT_NEAR(y, 1 - (a * std::exp(-t / a) - b * std::exp(-t / b)) / (a - b), 3e-6);
  }
  // Put back in the middle of an even motion it goes on as if it had been there.
  const auto moving = effect_of("lag@sensor.a:time_constant=0.08,second=0.25", step);
  moving->resume({2, 3, 0, 0}, {2 - 0.08 * 3, 3, 0, 0});
  for (int k = 1; k <= 100; ++k)
    EXPECT_NEAR(moving->signal(2 + 3 * k * step, k * step), 2 - 0.24 + 3 * k * step, 1e-12);
  // Of a parabola the value and two slopes around say what went in.
  const Shown in = moving->undo([](double later) { return Shown{later * later, 2 * later, 0, 0}; }, 0.1, 0, 0);
  EXPECT_NEAR(in.value, 0.01 + 0.08 * 0.2 + 0.25 * 0.75 * 0.08 * 0.08 * 2, 1e-12);
}

TEST(EffectValues, StribeckFrictionFallsAsItsExponentSays) {
  const auto f = force_of("stribeck_friction@force.a:static_excess=100,velocity=0.02,exponent=1", {0, -0.06, 0});
  EXPECT_NEAR(f.sliding_minus, 100 * std::exp(-3.0), 1e-9);
  EXPECT_EQ(f.breakaway_plus, 100);
}

TEST(EffectValues, StribeckFriction) {
  const auto f = force_of("stribeck_friction@force.a:static_excess=100,velocity=0.02", {0, -0.02, 0});
  EXPECT_NEAR(f.sliding_minus, 36.787944117144235, 1e-12);  // 100/e
  EXPECT_NEAR(f.sliding_plus, 36.787944117144235, 1e-12);
  EXPECT_EQ(f.breakaway_plus, 100);
  EXPECT_EQ(f.breakaway_minus, 100);
}

TEST(EffectValues, AsymmetricFriction) {
  const auto f = force_of("asymmetric_friction@force.a:difference=-60", {0, 0.1, 0});
  EXPECT_EQ(f.sliding_plus, -30);
  EXPECT_EQ(f.sliding_minus, 30);
  EXPECT_EQ(f.breakaway_plus, -30);
  EXPECT_EQ(f.breakaway_minus, 30);
}

TEST(EffectValues, LoadDependentFriction) {
  EXPECT_DOUBLE_EQ(force_of("load_dependent_friction@force.a:coefficient=2e-5", {0, 0.1, 3e6}).sliding_minus, 60);
  EXPECT_DOUBLE_EQ(force_of("load_dependent_friction@force.a:coefficient=2e-5", {0, 0.1, -3e6}).breakaway_plus, 60);
}

TEST(EffectValues, LoadForce) {
  EXPECT_DOUBLE_EQ(force_of("load_force@force.a:constant=-50,stiffness=1000", {0.02, 0, 0}).applied, -30);
}

TEST(EffectValues, AddedMass) { EXPECT_EQ(force_of("added_mass@force.a:mass=3", {}).mass, 3); }

TEST(EffectValues, EndStop) {
  EXPECT_NEAR(force_of("end_stop@force.a:position=0.05,stiffness=1e5", {0.053, 0, 0}).applied, 300, 1e-9);
  EXPECT_EQ(force_of("end_stop@force.a:position=0.05,stiffness=1e5", {0.049, 0, 0}).applied, 0);
}

TEST(EffectValues, BacklashAndElasticity) {
  Coupling c;
  effect_of("backlash@transmission.a:gap=2e-3")->coupling(c);
  effect_of("elasticity@transmission.a:compliance=1e-6,damping=50")->coupling(c);
  effect_of("scale@transmission.a:factor=0.9")->coupling(c);
  EXPECT_EQ(c.gap, 2e-3);
  EXPECT_EQ(c.compliance, 1e-6);
  EXPECT_EQ(c.damping, 50);
  EXPECT_EQ(c.factor, 0.9);
  Coupling rigid;
  effect_of("elasticity@transmission.a:compliance=0,damping=50")->coupling(rigid);
  EXPECT_EQ(rigid.damping, 0);  // no damper without a spring to move it
}

TEST(EffectValues, Deadband) {
  const auto e = effect_of("deadband@command.a:width=0.4");
  EXPECT_DOUBLE_EQ(e->signal(0.5, 0), 0.3);
  EXPECT_DOUBLE_EQ(e->signal(-0.5, 0), -0.3);
  EXPECT_EQ(e->signal(0.2, 0), 0);
  EXPECT_DOUBLE_EQ(effect_of("deadband@restriction.a:width=0.4")->opening(-1), -0.8);
}

TEST(EffectValues, HysteresisOfASignal) {
  const auto e = effect_of("hysteresis@command.a:width=0.2");
  EXPECT_DOUBLE_EQ(e->signal(1, 0), 1);       // starts at the first value
  EXPECT_DOUBLE_EQ(e->signal(1.05, 0), 1);    // inside
  EXPECT_DOUBLE_EQ(e->signal(2, 0), 1.9);     // pushed from below
  EXPECT_DOUBLE_EQ(e->signal(1.85, 0), 1.9);  // inside on the way back
  EXPECT_DOUBLE_EQ(e->signal(-1, 0), -0.9);   // pulled from above
}

TEST(EffectValues, HysteresisOfAForce) {
  const auto e = effect_of("hysteresis@force.a:width=10", 1e-3, 2);  // elastic over +-0.1 of travel
  const auto at = [&](double position) {
    BodyForces f;
    e->force({position, 0, 0}, f);
    return f.applied;
  };
  EXPECT_DOUBLE_EQ(at(0.5), 0);
  EXPECT_NEAR(at(0.55), 2.5, 1e-9);
  EXPECT_NEAR(at(0.55), 2.5, 1e-9);  // asking again changes nothing
  EXPECT_NEAR(at(1.5), 5, 1e-9);     // half the width
  EXPECT_NEAR(at(1.3), -5, 1e-9);    // the other half after 0.2 back
  EXPECT_NEAR(at(1.35), -2.5, 1e-9);
}

TEST(EffectValues, HysteresisLoopTakesItsAreaOut) {
  const auto e = effect_of("hysteresis@force.a:width=10", 1e-3, 2);
  double work = 0, last_force = 0, last_position = 0;
  for (int k = 0; k <= 20000; ++k) {  // two turns of +-1; the second is the closed loop
    const double position = std::sin(2 * 3.141592653589793 * k / 10000.0);
    BodyForces f;
    e->force({position, 0, 0}, f);
    if (k > 10000) work += 0.5 * (f.applied + last_force) * (position - last_position);
    last_force = f.applied;
    last_position = position;
  }
  EXPECT_NEAR(work, 10 * (2 - 0.2), 1e-3);  // parallelogram: width times (travel - 2 reach)
}

// A body that goes to and fro over 50 um and then over 5 um; bristles of 2e6 N/m yield 25 um under 50 N.
double rubbing_position(double time) { return (time < 1 ? 5e-5 : 5e-6) * std::sin(2 * 3.141592653589793 * 3 * time); }
double rubbing_speed(double time) {
  return (time < 1 ? 5e-5 : 5e-6) * 6 * 3.141592653589793 * std::cos(2 * 3.141592653589793 * 3 * time);
}

// Against Dahl's equation in small steps; the effect is asked at a two-hundredth of that rate, and at the places where
// a Runge-Kutta step tries.
TEST(EffectValues, PreslidingFriction) {
  const double force = 50, stiffness = 2e6;
  const int parts = 200;
  const auto e = effect_of("presliding_friction@force.a:force=50,stiffness=2e6", 1e-3);
  const auto asked = [&](double position, double velocity) {
    BodyForces sum;
    e->force({position, velocity, 0}, sum);
    EXPECT_EQ(sum.sliding_plus, -force);
    EXPECT_EQ(sum.breakaway_minus, -force);
    EXPECT_EQ(sum.applied, 0);
    return sum.viscous;
  };
  double z = 0, work = 0, last_force = asked(0, rubbing_speed(0)), last_position = 0;
  for (int k = 0; k < 2000; ++k) {
    const double time = k * 1e-3;
    for (const double share : {0.0, 0.5, 0.47, 1.0}) {
      const double trial = time + share * 1e-3;
      asked(rubbing_position(trial), rubbing_speed(trial));
    }
    for (int i = 0; i < parts; ++i) {
      const double from = rubbing_position(time + i * 1e-3 / parts);
      const double dx = rubbing_position(time + (i + 1) * 1e-3 / parts) - from;
      const double middle = z + 0.5 * dx * stiffness / force * (1 - (dx > 0 ? z : -z));
      z += dx * stiffness / force * (1 - (dx > 0 ? middle : -middle));
    }
    const double now = rubbing_position(time + 1e-3), held = asked(now, rubbing_speed(time + 1e-3));
    ASSERT_NEAR(held, force * z, 0.02 * force) << time;
    if (k >= 334 && k < 667) work += 0.5 * (held + last_force) * (now - last_position);  // a closed cycle
    last_force = held;
    last_position = now;
  }
  EXPECT_GT(work, 0.5 * force * 2e-4 / 2);  // of what sliding all the way would take
  EXPECT_LT(work, force * 2e-4);
}

TEST(EffectValues, PreslidingFrictionFollowsNoStateThatIsPutBack) {
  const auto e = effect_of("presliding_friction@force.a:force=50,stiffness=2e6", 1e-3);
  const auto asked = [&](double position, double velocity, bool rubs = true) {
    BodyForces sum;
    e->force({position, velocity, 0, rubs}, sum);
    return sum.viscous;
  };
  for (int k = 0; k <= 100; ++k) asked(k * 1e-6, 1e-3);
  const double wound = asked(100e-6, 1e-3);
  EXPECT_NEAR(wound, 50 * (1 - std::exp(-4.0)), 1e-9);
  EXPECT_NEAR(asked(100e-6, 0), wound, 1e-9);
  asked(160e-6, 0);
  EXPECT_NEAR(asked(40e-6, 0), wound, 1e-9);                                         // put back at rest
  EXPECT_EQ(asked(0.5, -1, false), 0);                                               // another body
  EXPECT_NEAR(asked(39.5e-6, -1e-3), wound - 2e6 * (1 + wound / 50) * 0.5e-6, 0.1);  // a turn unwinds twice as fast
}

TEST(EffectValues, GainCurve) {
  const auto e = effect_of("gain_curve@command.a:curvature=0.4", 1e-3, 10);
  EXPECT_DOUBLE_EQ(e->signal(5, 0), 4);
  EXPECT_DOUBLE_EQ(e->signal(-5, 0), -4);
  EXPECT_DOUBLE_EQ(e->signal(10, 0), 10);
}

TEST(EffectValues, RateLimit) {
  const auto e = effect_of("rate_limit@command.a:rate=20", 0.01);
  EXPECT_EQ(e->signal(3, 0), 3);
  EXPECT_DOUBLE_EQ(e->signal(4, 0.01), 3.2);
  EXPECT_DOUBLE_EQ(e->signal(3.3, 0.02), 3.3);
  EXPECT_DOUBLE_EQ(e->signal(0, 0.03), 3.1);
  e->set_size(0.5);  // twice as fast
  EXPECT_DOUBLE_EQ(e->signal(0, 0.04), 2.7);
}

TEST(EffectValues, Saturation) {
  const auto e = effect_of("saturation@command.a:limit=4");
  EXPECT_EQ(e->signal(5, 0), 4);
  EXPECT_EQ(e->signal(-5, 0), -4);
  EXPECT_EQ(e->signal(3, 0), 3);
}

TEST(EffectValues, OffsetAndScale) {
  const auto offset = effect_of("offset@sensor.a:value=-0.3");
  EXPECT_DOUBLE_EQ(offset->signal(1, 0), 0.7);
  EXPECT_DOUBLE_EQ(offset->undo_signal(0.7, 0), 1);
  EXPECT_DOUBLE_EQ(offset->boundary(2, 5, 0), 1.7);
  const auto scale = effect_of("scale@sensor.a:factor=1.25");
  EXPECT_DOUBLE_EQ(scale->signal(2, 0), 2.5);
  EXPECT_DOUBLE_EQ(scale->undo_signal(2.5, 0), 2);
  HeatPath heat;
  effect_of("scale@heat.a:factor=1.25")->heat(heat);
  EXPECT_EQ(heat.factor, 1.25);
}

TEST(EffectValues, Lag) {
  const auto e = effect_of("lag@sensor.a:time_constant=0.01", 1e-3);
  EXPECT_EQ(e->signal(5, 0), 5);
  for (int k = 1; k <= 10; ++k) e->signal(6, k * 1e-3);
  // The input ran from 5 to 6 within the first step and stayed there for ten.
  const double left = (1 - std::exp(-0.1)) / 0.1;
  EXPECT_NEAR(e->signal(6, 0.011), 6 - left * std::exp(-1.0), 1e-12);
  // A ramp is followed the time constant late, also where that is shorter than a step.
  for (const char* spec : {"lag@sensor.a:time_constant=0.01", "lag@sensor.a:time_constant=3e-4"}) {
    const auto late = effect_of(spec, 1e-3);
    double out = 0;
    for (int k = 0; k <= 300; ++k) out = late->signal(k * 1e-3, k * 1e-3);
    EXPECT_NEAR(0.3 - out, parse_effect(spec).parameters.front(), 1e-9) << spec;
  }
}

// Against the differential equation, integrated in steps of a thousandth, on an input of straight pieces.
TEST(EffectValues, SecondOrderLag) {
  for (const double damping : {0.1, 0.7, 1.0, 3.0}) {
    const double w = 120, step = 4e-3;
    const auto e =
        effect_of("second_order_lag@sensor.a:natural_frequency=120,damping=" + std::to_string(damping), step);
    double y = 1, speed = 0, before = 1;
    EXPECT_EQ(e->signal(1, 0), 1);
    for (int k = 1; k <= 60; ++k) {
      const double value = k < 3 ? 1 : k < 30 ? 2 : 2 + std::sin(0.9 * k);
      const int parts = 4000;
      const double dt = step / parts;
      const auto bend = [&](double at, double v, double part) {
        return w * w * (before + (value - before) * part / parts - at) - 2 * damping * w * v;
      };
      for (int i = 0; i < parts; ++i) {  // midpoint rule
        const double half_y = y + 0.5 * dt * speed, half_speed = speed + 0.5 * dt * bend(y, speed, i);
        y += dt * half_speed;
        speed += dt * bend(half_y, half_speed, i + 0.5);
      }
      before = value;
      ASSERT_NEAR(e->signal(value, k * step), y, 1e-6) << damping << " " << k;
    }
  }
  // A ramp is followed 2 damping/w late, also where that is far below a step.
  for (const double frequency : {30.0, 3e4, 1e8}) {
    const auto e = effect_of("second_order_lag@sensor.a:damping=0.6,natural_frequency=" + std::to_string(frequency));
    double out = 0;
    for (int k = 0; k <= 3000; ++k) out = e->signal(k * 1e-3, k * 1e-3);
    EXPECT_NEAR(3 - out, 1.2 / frequency, 1e-9) << frequency;
  }
}

TEST(EffectValues, Delay) {
  const auto e = effect_of("delay@sensor.a:time=2.25e-3", 1e-3);
  std::vector<double> out;
  for (int k = 0; k < 6; ++k) out.push_back(e->signal(10 + k, k * 1e-3));
  EXPECT_DOUBLE_EQ(out[0], 10);
  EXPECT_DOUBLE_EQ(out[2], 10);
  EXPECT_NEAR(out[3], 10.75, 1e-9);
  EXPECT_NEAR(out[5], 12.75, 1e-9);
  const auto short_delay = effect_of("delay@sensor.a:time=2.5e-4", 1e-3);
  short_delay->signal(0, 0);
  EXPECT_NEAR(short_delay->signal(1, 1e-3), 0.75, 1e-12);
}

TEST(EffectValues, DelayLongEnoughToGoRoundItsRing) {
  const auto e = effect_of("delay@sensor.a:time=0.007", 1e-3);
  for (int k = 0; k < 1000; ++k) {
    const double y = e->signal(k, k * 1e-3);
    ASSERT_NEAR(y, std::max(0, k - 7), 1e-9) << k;
  }
}

TEST(EffectValues, Drift) {
  const auto e = effect_of("drift@sensor.a:rate=0.2");
  EXPECT_DOUBLE_EQ(e->signal(1, 5), 2);
  EXPECT_DOUBLE_EQ(e->undo_signal(2, 5), 1);
  EXPECT_DOUBLE_EQ(e->boundary(1, 0, 10), 3);
  const auto later = effect_of("drift@sensor.a:rate=0.2", 1e-3, 1, 4);
  later->set_size(0.3);  // size does not matter once it has started
  EXPECT_DOUBLE_EQ(later->signal(1, 3.9), 1);
  EXPECT_DOUBLE_EQ(later->signal(1, 4), 1);
  EXPECT_DOUBLE_EQ(later->signal(1, 9), 2);
}

TEST(EffectValues, Quantisation) {
  const auto e = effect_of("quantisation@sensor.a:step=0.25");
  EXPECT_DOUBLE_EQ(e->signal(0.37, 0), 0.25);
  EXPECT_DOUBLE_EQ(e->signal(0.38, 0), 0.5);
  EXPECT_DOUBLE_EQ(e->signal(-0.38, 0), -0.5);
}

TEST(EffectValues, NoiseIsWhiteNormalAndSeeded) {
  const int count = 200000;
  const auto e = effect_of("noise@sensor.a:std=0.5", 1e-3, 1, kNoShape, 3);
  const auto same = effect_of("noise@sensor.a:std=0.5", 1e-3, 1, kNoShape, 3);
  const auto other = effect_of("noise@sensor.a:std=0.5", 1e-3, 1, kNoShape, 4);
  double sum = 0, square = 0, fourth = 0, lagged = 0, across = 0, last = 0;
  for (int k = 0; k < count; ++k) {
    const double n = e->signal(2, 0) - 2;
    ASSERT_EQ(same->signal(2, 0) - 2, n);
    sum += n;
    square += n * n;
    fourth += n * n * n * n;
    lagged += n * last;
    across += n * (other->signal(2, 0) - 2);
    last = n;
  }
  // Five standard errors each.
  EXPECT_NEAR(sum / count, 0, 0.0056);
  EXPECT_NEAR(std::sqrt(square / count), 0.5, 0.004);
  EXPECT_NEAR(fourth * count / (square * square), 3, 0.055);
  EXPECT_NEAR(lagged / square, 0, 0.0112);
  EXPECT_NEAR(across / square, 0, 0.0112);
}

TEST(EffectValues, Stuck) {
  const auto e = effect_of("stuck@sensor.a:from=2");
  EXPECT_EQ(e->signal(1, 1.9), 1);
  EXPECT_EQ(e->signal(5, 2), 1);
  EXPECT_EQ(e->signal(6, 100), 1);
  EXPECT_EQ(e->undo_signal(3, 1.9), 3);
  EXPECT_TRUE(std::isnan(e->undo_signal(1, 2)));
  e->reset();
  EXPECT_EQ(e->signal(7, 3), 7);  // nothing before it: the first value
  EXPECT_EQ(e->signal(8, 3.1), 7);
}

TEST(EffectValues, OrificeLeakage) {
  const auto e = effect_of("orifice_leakage@flow.a_b:coefficient=2e-9");
  EXPECT_NEAR(e->flow({4e6, 4e6, 0}), 4e-6, 1e-12);                        // 2e-9 sqrt(4e6)
  EXPECT_NEAR(e->flow({-1000, 0, 0}), -2e-9 * 26.591479484724942, 1e-18);  // 1000/(2e6)^(1/4)
  EXPECT_EQ(e->flow({0, 0, 0}), 0);
}

TEST(EffectValues, OtherLeaks) {
  EXPECT_DOUBLE_EQ(effect_of("laminar_leakage@flow.a_b:coefficient=3e-12")->flow({-2e6, 0, 0}), -6e-6);
  EXPECT_DOUBLE_EQ(effect_of("speed_leakage@flow.a_b:coefficient=1e-14")->flow({2e6, 0, -100}), 2e-6);
  const auto relief = effect_of("relief_opening@flow.a_tank:cracking_pressure=7e6,slope=1e-11");
  EXPECT_DOUBLE_EQ(relief->flow({8e6, 8e6, 0}), 1e-5);
  EXPECT_EQ(relief->flow({6.9e6, 6.9e6, 0}), 0);
}

TEST(EffectValues, CloggingAndAreaCurve) {
  EXPECT_DOUBLE_EQ(effect_of("clogging@restriction.a:fraction=0.25")->opening(-8), -6);
  EXPECT_DOUBLE_EQ(effect_of("clogging@restriction.a:fraction=-0.15")->opening(2), 2.3);
  const auto curve = effect_of("area_curve@restriction.a:exponent=2", 1e-3, 10);
  EXPECT_DOUBLE_EQ(curve->opening(5), 2.5);
  EXPECT_DOUBLE_EQ(curve->opening(-5), -2.5);
  EXPECT_DOUBLE_EQ(curve->opening(10), 10);
}

// Both edges open within +-0.2: what passes is their difference.
TEST(EffectValues, Underlap) {
  const auto e = effect_of("underlap@restriction.a:width=0.4");
  EXPECT_DOUBLE_EQ(e->opening(0.5), 0.7);
  EXPECT_DOUBLE_EQ(e->opening(-0.5), -0.7);
  EXPECT_DOUBLE_EQ(e->opening(0.1), 0.2);
  EXPECT_DOUBLE_EQ(e->edge(0), 0.2);
  for (double x : {-0.9, -0.2, -0.05, 0.0, 0.13, 0.4})
    EXPECT_DOUBLE_EQ(e->opening(x), std::max(0.0, e->edge(x)) - std::max(0.0, e->edge(-x)));
  const auto overlap = effect_of("deadband@restriction.a:width=0.4");
  for (double x : {-0.9, -0.1, 0.1, 0.9})
    EXPECT_DOUBLE_EQ(overlap->opening(x), std::max(0.0, overlap->edge(x)) - std::max(0.0, overlap->edge(-x)));
  const auto command = effect_of("underlap@command.a:width=0.4");
  EXPECT_DOUBLE_EQ(command->signal(0.1, 0), 0.2);
  EXPECT_DOUBLE_EQ(command->undo_signal(0.2, 0), 0.1);
  EXPECT_DOUBLE_EQ(command->undo_signal(-0.7, 0), -0.5);
}

TEST(EffectValues, FlowExponent) {
  const auto e = effect_of("flow_exponent@restriction.a:exponent=0.75,nominal_drop=2e5");
  EXPECT_DOUBLE_EQ(e->drop(2e5), 2e5);
  // At four times the drop the flow is 4^0.75 times as large, not twice.
  EXPECT_NEAR(std::sqrt(e->drop(8e5) / 2e5), std::pow(4, 0.75), 1e-12);
  EXPECT_NEAR(e->drop(-8e5), -e->drop(8e5), 1e-9);
  EXPECT_EQ(e->drop(0), 0);
}

TEST(EffectValues, OverflowOfWhichAShareArrives) {
  const auto e = effect_of("overflow@flow.a_b:rim=5000,slope=2e-7,share=0.3");
  EXPECT_DOUBLE_EQ(e->flow({5500, 5500, 0}), 1e-4);
  EXPECT_EQ(e->flow({5000, 4999, 0}), 0);
  EXPECT_EQ(e->arriving_share(), 0.3);
  EffectChain chain;
  const auto leak = effect_of("laminar_leakage@flow.a_b:coefficient=1e-9");
  chain.add(e.get());
  chain.add(leak.get());
  EXPECT_DOUBLE_EQ(chain.flow({5500, 5500, 0}), 1e-4 + 5.5e-6);
  EXPECT_DOUBLE_EQ(chain.arriving({5500, 5500, 0}), 0.3e-4 + 5.5e-6);
}

TEST(EffectValues, Compliance) {
  const auto air = effect_of("entrained_air@compliance.a:fraction=0.01");
  // At ambient pressure: 1/1e9 + 0.01/101325.
  EXPECT_NEAR(air->bulk_modulus(1e9, 101325), 1 / (1e-9 + 0.01 / 101325), 1e-3);
  EXPECT_NEAR(air->bulk_modulus(1e9, 1e6), 496709300.88, 0.1);
  EXPECT_EQ(air->bulk_modulus(1e9, -5e4), air->bulk_modulus(1e9, 2e4));
  // Adiabatic: (p0/p)^(1/1.4)/(1.4 p) at 1e6 Pa is 1.3952e-7 times the fraction.
  const auto hot = effect_of("entrained_air@compliance.a:fraction=0.01,exponent=1.4");
  EXPECT_NEAR(1 / hot->bulk_modulus(1e9, 1e6) - 1e-9, 0.01 * std::pow(0.101325, 1 / 1.4) / 1.4e6, 1e-16);
  EXPECT_EQ(to_string(parse_effect("entrained_air@compliance.a:fraction=0.01")),
            "entrained_air@compliance.a:fraction=0.01,exponent=1");
  EXPECT_THROW(parse_effect("entrained_air@compliance.a:exponent=1.2"), InputError);
  EXPECT_DOUBLE_EQ(effect_of("compliance_factor@compliance.a:factor=0.5")->bulk_modulus(1.4e9, 0), 7e8);
}

TEST(EffectValues, Source) {
  EXPECT_DOUBLE_EQ(effect_of("droop@source.a:resistance=1e9")->boundary(7e6, 5e-4, 0), 6.5e6);
  const auto ripple = effect_of("ripple@source.a:amplitude=1e5,frequency=10");
  EXPECT_NEAR(ripple->boundary(7e6, 0, 0.025), 7.1e6, 1e-6);
  EXPECT_NEAR(ripple->boundary(7e6, 0, 0.075), 6.9e6, 1e-6);
  const auto ahead = effect_of("ripple@source.a:amplitude=1e5,frequency=10,phase=1.5707963267948966");
  EXPECT_NEAR(ahead->boundary(7e6, 0, 0), 7.1e6, 1e-6);
  EXPECT_NEAR(ahead->boundary(7e6, 0, 0.05), 6.9e6, 1e-6);
  const auto pump = effect_of("displacement_ripple@source.a:amplitude=0.1,order=9");
  EXPECT_NEAR(pump->delivery(2e-4, 3.141592653589793 / 18), 2.2e-4, 1e-16);
  Viscosity viscosity;
  effect_of("viscosity_drift@source.a:factor=0.8")->viscosity(viscosity);
  effect_of("viscosity_drift@source.a:factor=0.5")->viscosity(viscosity);
  EXPECT_DOUBLE_EQ(viscosity.factor, 0.4);
}

TEST(EffectValues, LineAndHeat) {
  Line line;
  effect_of("line_inertia@line.a:inertance=4e6")->line(line);
  EXPECT_EQ(line.inertance, 4e6);
  HeatPath scaled;
  PortContext context;
  const EffectType& free = *find_effect_type("free_signal");
  for (const bool only_scaled : {false, true}) {
    context.only_scaled = only_scaled;
    auto effect = free.make();
    effect->configure({0.25}, {0}, context);
    effect->heat(scaled);
  }
  EXPECT_EQ(scaled.loss, 0.25);  // where heat is lost; else a fraction of the flux
  EXPECT_EQ(scaled.factor, 1.25);
  HeatPath heat;
  effect_of("heat_loss@heat.a:coefficient=30")->heat(heat);
  effect_of("heat_capacity@heat.a:capacity=700")->heat(heat);
  EXPECT_EQ(heat.loss, 30);
  EXPECT_EQ(heat.capacity, 700);
}

}  // namespace
}  // namespace faultline

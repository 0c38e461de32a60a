// Models beside one another (numerics/integrator.h): what they say of parameters, effects and start states is what runs
// of their own say, or nearer to what short steps say.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "faultline/attribution/fault_hypothesis.h"
#include "faultline/segments/segment_model.h"
#include "rigs/control_valve/runs.h"
#include "rigs/cooling_circuit/runs.h"
#include "rigs/pump_cylinder/runs.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

constexpr float kNear = 0.08f;  // of a response, that one by a run of its own may be apart ...
constexpr float kSmall = 0.1f;  // ... or this root of a sum of squares, in noises over a whole run

SegmentOptions with_long_steps() {
  SegmentOptions options;
  options.long_steps = options.beside = options.rough = true;
  return options;
}

struct Course {
  const Datasheet& sheet;
  SegmentModel model{sheet, with_long_steps()};
  SegmentedRun run;
  std::vector<double> sigma;

  Course(const Datasheet& of, const std::string& profile, double segment, double duration = 3) : sheet(of) {
    SimulationSetup setup;
    setup.profile = profile;
    setup.parameters = draw_parameters(of, 3);
    run = cut_run(of, "run", simulate(of, setup, duration), segment);
    sigma = noise_of(of, {run});
    model.place_starts(run, sigma, model.nominal());
  }
  DrivenModel driven(const ModelChange& change) const {
    SimulationSetup setup;
    setup.parameters = change.parameters;
    setup.effects = change.effects;
    setup.long_steps = setup.beside = setup.rough = true;
    return {sheet, setup};
  }
};

// Every parameter by half a tolerance, and every cause that a datasheet allows, where it changes the Jacobian little.
std::vector<ModelChange> changes(const Datasheet& sheet) {
  std::vector<ModelChange> result;
  for (std::size_t i = 0; i < sheet.parameters.size(); ++i) {
    result.push_back({sheet.nominal(), {}});
    result.back().parameters[i] *= 1 + 0.5 * sheet.parameters[i].tolerance;
  }
  for (const FaultHypothesis& h : fault_hypotheses(sheet, HypothesisOptions()))
    result.push_back({sheet.nominal(), {h.at(h.effect == "added_mass" ? 0.05 * h.probe : h.probe)}});
  return result;
}

std::string name_of(const ModelChange& change) {
  return change.effects.empty() ? "a parameter" : change.effects.front().effect + "@" + change.effects.front().port;
}

void expect_as_near(const Course& course, std::size_t least, float within = kNear, float small = kSmall) {
  const ModelChange nominal = course.model.nominal();
  const std::vector<ModelChange> all = changes(course.sheet);
  std::vector<SegmentModel::Variant> variants{{&nominal, starts_of(course.run)}};
  for (const ModelChange& change : all) variants.push_back({&change, variants.front().starts});
  for (const int jobs : {1, 2}) {
    const std::vector<Eigen::MatrixXf> together = course.model.residuals(variants, course.run, course.sigma, jobs);
    const Eigen::MatrixXf now = course.model.residuals(nominal, course.run, course.sigma);
    EXPECT_EQ((together[0] - now).squaredNorm(), 0.0f);
    std::size_t beside = 0;
    const DrivenModel leader = course.driven(nominal);
    for (std::size_t i = 0; i < all.size(); ++i) {
      const Eigen::MatrixXf alone = course.model.residuals(all[i], course.run, course.sigma) - now;
      const float apart = (together[i + 1] - now - alone).norm();
      EXPECT_LT(apart, std::max(small, within * alone.norm())) << i << " " << name_of(all[i]) << " of " << alone.norm();
      const DrivenModel own = course.driven(all[i]);
      if (!own.goes_beside(leader) || own.moves_as(leader)) {
        EXPECT_EQ(apart, 0.0f) << name_of(all[i]);
      }
      beside += own.goes_beside(leader);
    }
    EXPECT_GE(beside, least);
  }
}

TEST(Beside, CylinderRespondsAsAlone) { expect_as_near({cylinder(), "steps", 0.25}, 30); }
TEST(Beside, CoolingCircuitRespondsAsAlone) { expect_as_near({cooling(), "valve_steps", 0.2}, 100); }

// Its spool has no mass and settles within a step, and whether it moves at all is friction's to say: what changes
// that is a tenth off, all else as above.
TEST(Beside, ControlValveRespondsAsAlone) { expect_as_near({valve(), "duty", 1.0}, 30, 0.12f); }
// Where its flapper or spool stand at a stop a difference across that is no derivative.
TEST(Beside, ControlValveAtItsStopsRespondsAsAlone) { expect_as_near({valve(), "steps", 1.0, 20}, 30, 0.2f, 1.0f); }

// Steps with an event in them are taken alone.
TEST(Beside, ServoActuatorRespondsAsAlone) { expect_as_near({servo(), "random", 0.25}, 30); }

// Sensors of a rig whose starts are not read from them move nothing; another start does.
TEST(Beside, OnlySensorsMoveAsTheLeader) {
  const Course course(cooling(), "valve_steps", 0.2);
  const ModelChange nominal = course.model.nominal();
  const DrivenModel leader = course.driven(nominal);
  const auto moves_as = [&](const std::string& effect) {
    return course.driven({nominal.parameters, {parse_effect(effect)}}).moves_as(leader);
  };
  EXPECT_TRUE(moves_as("lag@sensor.m_inlet_pressure:time_constant=0.1"));
  EXPECT_FALSE(moves_as("offset@sensor.supply_pressure:value=1e5"));
  EXPECT_FALSE(moves_as("clogging@restriction.m_feed:fraction=0.1"));
  ModelChange moved = nominal;
  moved.parameters[0] *= 1.001;
  EXPECT_FALSE(course.driven(moved).moves_as(leader));
  const Course shown(cylinder(), "steps", 0.25);
  EXPECT_FALSE(shown.driven(shown.model.nominal()).moves_as(shown.driven(shown.model.nominal())));

  std::vector<SegmentModel::Variant> variants(2, {&nominal, starts_of(course.run)});
  const auto state =
      std::find_if(cooling().states.begin(), cooling().states.end(), [](const State& s) { return s.name == "m_t2"; });
  ASSERT_NE(state, cooling().states.end());
  variants[1].starts[cooling().states.size() * 3 + static_cast<std::size_t>(state - cooling().states.begin())] = 320;
  const std::vector<Eigen::MatrixXf> both = course.model.residuals(variants, course.run, course.sigma, 1);
  EXPECT_GT((both[1] - both[0]).norm(), 1);
}

TEST(Beside, StartsAreAsAlone) {
  const Course course(cylinder(), "steps", 0.25);
  const ModelChange nominal = course.model.nominal();
  const std::vector<Eigen::MatrixXf> columns = course.model.start_columns(nominal, course.run, course.sigma);
  const Eigen::MatrixXf now = course.model.residuals(nominal, course.run, course.sigma);
  const double step = course.model.options().start_difference_sigma;
  ASSERT_EQ(columns.size(), 3u);
  for (std::size_t i = 0; i < columns.size(); ++i) {
    SegmentedRun moved = course.run;
    for (Eigen::VectorXd& shift : moved.start_shift) shift[static_cast<Eigen::Index>(i)] += step;
    const Eigen::MatrixXf alone =
        (course.model.residuals(nominal, moved, course.sigma) - now) / static_cast<float>(step);
    EXPECT_LT((columns[i] - alone).norm(), kNear * alone.norm()) << i;
  }
}

// Effects with states or a memory in the equations take runs of their own, and explicit methods that may meet an event
// in every step.
TEST(Beside, WhatIsOfAnotherShapeGoesAlone) {
  const Course course(cylinder(), "steps", 0.25);
  const DrivenModel leader = course.driven(course.model.nominal());
  const auto goes = [&](const char* effect) {
    return course.driven({cylinder().nominal(), {parse_effect(effect)}}).goes_beside(leader);
  };
  EXPECT_TRUE(goes("laminar_leakage@flow.chamber_a_chamber_b:coefficient=1e-13"));
  EXPECT_TRUE(goes("lag@sensor.position:time_constant=0.002"));
  EXPECT_FALSE(goes("line_inertia@line.a:inertance=1e6"));
  EXPECT_FALSE(goes("displacement_ripple@source.pump2:amplitude=0.01,order=9"));
  const DrivenModel one(servo(), {}), other(servo(), {});
  EXPECT_FALSE(one.goes_beside(other));
}

}  // namespace
}  // namespace faultline

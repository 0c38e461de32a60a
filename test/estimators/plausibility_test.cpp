// What another reading of a stretch has to beat, and since when it holds.
#include "faultline/estimators/plausibility.h"

#include <gtest/gtest.h>

#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

constexpr double kStuckFrom = 4.15;

// A servo actuator whose valve is held from `kStuckFrom` on where it was then: what was recorded just before, what is
// looked at, and what it does if one takes the held command for what was given.
struct Held {
  Held() : run(simulate(servo(), setup(), 8)), model(servo(), settings()), point(model.nominal()) {
    point.parameters = setup().parameters;
  }

  static SimulationSetup setup() {
    SimulationSetup setup = off_nominal("random", 37);
    setup.effects.push_back(parse_effect("stuck@command.valve_command:from=" + std::to_string(kStuckFrom)));
    return setup;
  }

  static ResponseSettings settings() {
    ResponseSettings settings;
    settings.segment_s = 0.1;
    settings.segments = 16;
    return settings;
  }

  Recording piece(double from) const {
    Recording piece;
    piece.rig = run.rig;
    piece.channels = run.channels;
    const auto first = static_cast<std::size_t>(from / servo().sample_period);
    const auto rows = static_cast<std::size_t>(settings().stretch_s() / servo().sample_period) + 1;
    for (std::size_t k = first; k < first + rows; ++k) piece.append(run.sample(k));
    return piece;
  }

  // The command is held where a stretch begins; and an offset of a transducer that changes next to nothing.
  std::vector<ModelPoint> explained(bool by_two) const {
    ModelPoint cause = point;
    cause.effects.push_back(parse_effect("stuck@command.valve_command:from=0"));
    if (by_two) cause.effects.push_back(parse_effect("offset@sensor.position:value=1e-5"));
    return {cause};
  }

  OtherReading reading(double from, const std::vector<ModelPoint>& faults, const Recording& before) const {
    return better_reading(servo(), model, *model.prepare(piece(from)), faults, point, true, before);
  }

  const Recording run;
  const StretchModel model;
  ModelPoint point;
};

TEST(Plausibility, WhatNeedsTwoFaultsHasNoLead) {
  const Held held;
  const OtherReading alone = held.reading(kStuckFrom, {held.point}, held.piece(2));
  ASSERT_TRUE(alone.is_stuck()) << alone.text;
  EXPECT_EQ(stuck_port(servo(), alone), "command.valve_command");
  EXPECT_TRUE(held.reading(kStuckFrom, held.explained(false), held.piece(2)).text.empty());
  EXPECT_EQ(stuck_port(servo(), held.reading(kStuckFrom, held.explained(true), held.piece(2))),
            "command.valve_command");
}

// The stretch before holds the beginning where it was not seen there.
TEST(Plausibility, AHeldCommandIsDatedBySegments) {
  const Held held;
  const double before_ends_after = kStuckFrom + 0.5;
  const Recording before = held.piece(before_ends_after - Held::settings().stretch_s());
  ASSERT_GT(before.time.back(), kStuckFrom + 0.3);
  EXPECT_NEAR(held.reading(5, {held.point}, before).since, kStuckFrom, 0.15);
  EXPECT_NEAR(held.reading(5, {held.point}, held.piece(1)).since, 5, 0.3);
}

}  // namespace
}  // namespace faultline

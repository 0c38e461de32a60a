// Dry friction: sticking, breaking away, stopping at a reversal; and a block on a driven spring against its exact
// solution.
#include "faultline/rig/friction.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace faultline {
namespace {

TEST(DryFriction, StartsInTheModeOfItsSpeed) {
  DryFriction friction;
  friction.start(0);
  EXPECT_TRUE(friction.stuck());
  EXPECT_EQ(friction.force(3, 5), 0);
  friction.start(0.1);
  EXPECT_EQ(friction.direction(), 1);
  EXPECT_EQ(friction.force(3, 5), 3);
  friction.start(-0.1);
  EXPECT_EQ(friction.direction(), -1);
  EXPECT_EQ(friction.force(3, 5), -5);
}

TEST(DryFriction, HoldsUpToTheBreakawayLevelOnEachSide) {
  DryFriction friction;
  friction.start(0);
  double velocity = 0;
  for (const double force : {9.99, 10.0, -19.99, -20.0, 0.0}) {
    friction.after_step(velocity, force, 10, 20);
    EXPECT_TRUE(friction.stuck()) << force;
    EXPECT_EQ(velocity, 0);
  }
  friction.after_step(velocity, 10.01, 10, 20);
  EXPECT_EQ(friction.direction(), 1);
  friction.start(0);
  friction.after_step(velocity, -20.01, 10, 20);
  EXPECT_EQ(friction.direction(), -1);
}

TEST(DryFriction, StopsAtAReversalAndGoesOnIfPushed) {
  DryFriction friction;
  friction.start(1);
  double velocity = -0.01;
  friction.after_step(velocity, 5, 10, 10);
  EXPECT_TRUE(friction.stuck());
  EXPECT_EQ(velocity, 0);
  friction.start(1);
  velocity = -0.01;
  friction.after_step(velocity, -50, 10, 10);
  EXPECT_EQ(velocity, 0);
  EXPECT_EQ(friction.direction(), -1);
}

TEST(DryFriction, WhatNothingHoldsGoesThroughZeroAsItComes) {
  DryFriction friction;
  friction.start(1);
  double velocity = -0.01;
  friction.after_step(velocity, 5, 0, 0);
  EXPECT_EQ(velocity, -0.01);
  EXPECT_EQ(friction.direction(), -1);
  friction.start(0);
  velocity = 0;
  friction.after_step(velocity, 1e-9, 0, 0);
  EXPECT_EQ(friction.direction(), 1);
}

TEST(DryFriction, BlockOnASpringStopsWhereItShould) {
  // m x'' = -k x - F sgn v from x0: every half swing loses 2 F/k, and it stops when |x| < F/k at a turn.
  const double mass = 2, stiffness = 200, level = 10, dt = 1e-5;
  DryFriction friction;
  double position = 0.47, velocity = 0;
  friction.start(0);
  int turns = 0;
  bool was_stuck = true;
  for (int k = 0; k < 1000000; ++k) {
    const double force = -stiffness * position;
    if (!friction.stuck()) {
      velocity += dt * (force - friction.force(level, level)) / mass;
      position += dt * velocity;
    }
    friction.after_step(velocity, -stiffness * position, level, level);
    if (was_stuck && !friction.stuck()) ++turns;
    was_stuck = friction.stuck();
  }
  // Turns at 0.47, -0.37, 0.27, -0.17, 0.07; the last is beyond 0.05, so once more, to -(0.07 - 0.1) = 0.03, which
  // holds.
  EXPECT_NEAR(std::abs(position), 0.03, 1e-4);
  EXPECT_EQ(velocity, 0);
  EXPECT_TRUE(friction.stuck());
}

}  // namespace
}  // namespace faultline

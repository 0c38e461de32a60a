// How wrong a model is, by place; the filter behind it; and what follows from both.
#include "faultline/gap/discrepancy.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include <fmt/format.h>
#include <Eigen/Dense>

#include "faultline/gap/linearisation.h"
#include "faultline/gap/signal_scan.h"
#include "faultline/gap/verdict.h"
#include "faultline/numerics/random.h"
#include "rigs/control_valve/runs.h"
#include "rigs/cooling_circuit/runs.h"
#include "rigs/pump_cylinder/runs.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

constexpr std::size_t kRows = 2000;  // of a scalar model

// One state x' = 0.9 x + 0.1 u + w, y = x + v, with a slow u.
StochasticModel scalar_model(double level, std::uint64_t seed, std::vector<double>* signal = nullptr) {
  Random random(seed);
  StochasticModel model;
  model.step = 0.01;
  model.block = 50;
  model.size = Eigen::VectorXd::Ones(1);
  model.ports = {"force.a", "sensor.y"};
  model.shows = {-1, 0};
  model.shown = {0, 1};
  model.unit = {1, 1};
  StochasticStretch stretch;
  const double keep = std::exp(-model.step / 0.5);
  double x = 0, u = 0;
  for (std::size_t i = 0; i < kRows; ++i) {
    stretch.rows.push_back(i);
    stretch.reference.push_back(Eigen::VectorXd::Zero(1));
    stretch.h.push_back(Eigen::MatrixXd::Constant(1, 1, 10));  // noise of a tenth of the state's size
    stretch.misfit.push_back(Eigen::VectorXd::Constant(1, 10 * x + random.normal()));
    if (signal) signal->push_back(u);
    if (i + 1 == kRows) break;
    stretch.f.push_back(Eigen::MatrixXd::Constant(1, 1, 0.9));
    stretch.defect.push_back(Eigen::VectorXd::Zero(1));
    stretch.bend.push_back(Eigen::VectorXd::Zero(1));
    stretch.lost.push_back(0);
    x = 0.9 * x + 0.1 * u + 0.01 * random.normal();
    u = keep * u + level * std::sqrt(1 - keep * keep) * random.normal();
  }
  stretch.port_drives = {Eigen::MatrixXd::Constant(1, static_cast<Eigen::Index>(kRows - 1), 0.1), {}};
  model.stretches = {stretch};
  return model;
}

double loss(const StochasticModel& model, double q, const FreeSignal& signal) {
  double sum = 0;
  for (const double block : block_losses(model, Eigen::VectorXd::Constant(1, q), signal)) sum += block;
  return sum;
}

TEST(FreeSignalFilter, IsLikeliestWithWhatMadeTheReadings) {
  const StochasticModel model = scalar_model(1, 3);
  FreeSignal right;
  right.port = 0;
  right.level = 1;
  right.memory = 0.5;
  const double least = loss(model, 1e-4, right);
  FreeSignal other = right;
  other.level = 0.2;
  EXPECT_LT(least + 10, loss(model, 1e-4, other));
  other = right;
  other.memory = 0.02;
  EXPECT_LT(least + 10, loss(model, 1e-4, other));
  EXPECT_LT(least + 10, loss(model, 1e-4, {}));
  EXPECT_LT(least + 10, loss(model, 1e-2, {}));  // nor is it white noise on the state
  other = right;
  other.port = 1;
  EXPECT_LT(least + 10, loss(model, 1e-4, other));
}

// Against all readings as one normal vector, whose covariance is written out.
TEST(FreeSignalFilter, HasTheLikelihoodOfAllReadingsTogether) {
  constexpr int kStates = 2, kOutputs = 3, kSteps = 7;
  Random random(11);
  const auto drawn = [&](Eigen::Index rows, Eigen::Index columns) {
    return Eigen::MatrixXd(Eigen::MatrixXd::NullaryExpr(rows, columns, [&] { return random.normal(); }));
  };
  StochasticModel model;
  model.step = 0.1;
  model.block = kSteps;
  model.size = Eigen::VectorXd::Ones(kStates);
  model.ports = {"flow.in", "sensor.second"};
  model.shows = {-1, 1};
  model.shown = {0, 2.5};
  model.unit = {1, 1};
  StochasticStretch stretch;
  for (std::size_t i = 0; i < kSteps; ++i) {
    stretch.rows.push_back(i);
    stretch.reference.push_back(Eigen::VectorXd::Zero(kStates));
    stretch.h.push_back(drawn(kOutputs, kStates));  // each shows both states, so that the head knows their size alone
    stretch.misfit.push_back(3 * drawn(kOutputs, 1));
    if (i + 1 == kSteps) break;
    stretch.f.push_back(0.5 * drawn(kStates, kStates));
    stretch.defect.push_back(drawn(kStates, 1));
    stretch.bend.push_back(drawn(kStates, 1).cwiseAbs2());
    stretch.lost.push_back(0);
  }
  stretch.misfit[2][1] = stretch.misfit[4][0] = std::nan("");
  stretch.port_drives = {drawn(kStates, kSteps - 1), {}};
  model.stretches = {stretch};
  const Eigen::Vector2d q(0.3, 0.02);
  for (const int port : {-1, 0, 1}) {
    FreeSignal signal;
    signal.port = port;
    signal.level = 0.7;
    signal.memory = 0.4;
    const double keep = std::exp(-model.step / signal.memory);
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    Eigen::Matrix3d here = Eigen::Vector3d(1, 1, 0.49).asDiagonal();
    std::vector<Eigen::MatrixXd> cross;  // of the state now and each earlier one
    Eigen::MatrixXd all = Eigen::MatrixXd::Identity(kOutputs * kSteps, kOutputs * kSteps);
    Eigen::VectorXd off(kOutputs * kSteps);
    std::vector<Eigen::MatrixXd> shown;
    for (std::size_t i = 0; i < kSteps; ++i) {
      Eigen::MatrixXd h = Eigen::MatrixXd::Zero(kOutputs, 3);
      h.leftCols(2) = stretch.h[i];
      if (port == 1) h(1, 2) = 2.5;
      shown.push_back(h);
      cross.push_back(here);
      const auto at = static_cast<Eigen::Index>(i) * kOutputs;
      off.segment(at, kOutputs) = stretch.misfit[i] - h * mean;
      for (std::size_t j = 0; j <= i; ++j) {
        const Eigen::MatrixXd block = h * cross[j] * shown[j].transpose();
        all.block(at, static_cast<Eigen::Index>(j) * kOutputs, kOutputs, kOutputs) += block;
        if (j < i) all.block(static_cast<Eigen::Index>(j) * kOutputs, at, kOutputs, kOutputs) += block.transpose();
      }
      if (i + 1 == kSteps) break;
      Eigen::Matrix3d map = Eigen::Matrix3d::Zero();
      map.topLeftCorner(2, 2) = stretch.f[i];
      if (port == 0) map.col(2).head(2) = stretch.port_drives[0].col(static_cast<Eigen::Index>(i));
      map(2, 2) = keep;
      mean = (map * mean).eval();
      mean.head(2) += stretch.defect[i];
      for (Eigen::MatrixXd& c : cross) c = (map * c).eval();
      here = (map * here * map.transpose()).eval();
      here.diagonal() += Eigen::Vector3d(q[0], q[1], 0.49 * (1 - keep * keep));
      here.diagonal().head(2) += stretch.bend[i];
    }
    std::vector<Eigen::Index> counts;
    for (Eigen::Index i = 0; i < off.size(); ++i)
      if (!std::isnan(off[i])) counts.push_back(i);
    const auto count = static_cast<Eigen::Index>(counts.size());
    Eigen::MatrixXd covariance(count, count);
    Eigen::VectorXd readings(count);
    for (Eigen::Index i = 0; i < count; ++i) {
      readings[i] = off[counts[static_cast<std::size_t>(i)]];
      for (Eigen::Index j = 0; j < count; ++j)
        covariance(i, j) = all(counts[static_cast<std::size_t>(i)], counts[static_cast<std::size_t>(j)]);
    }
    const double n = static_cast<double>(counts.size());
    const double square = readings.dot(covariance.ldlt().solve(readings));
    const double expected = 0.5 * std::log(covariance.determinant()) + 0.5 * n * std::log(square / n);
    const std::vector<double> losses = block_losses(model, q, signal);
    ASSERT_EQ(losses.size(), 1u);
    EXPECT_NEAR(losses.front(), expected, 1e-8) << port;
  }
}

TEST(FreeSignalFilter, WinsNothingWhereNothingIsMissing) {
  const StochasticModel model = scalar_model(0, 4);
  FreeSignal signal;
  signal.port = 0;
  signal.level = 0.3;
  signal.memory = 0.5;
  EXPECT_GT(loss(model, 1e-4, signal), loss(model, 1e-4, {}) + 5);
}

TEST(FreeSignalFilter, SmoothingGivesTheSignalAndItsSpread) {
  std::vector<double> truth;
  const StochasticModel model = scalar_model(1, 5, &truth);
  FreeSignal signal;
  signal.port = 0;
  signal.level = 1;
  signal.memory = 0.5;
  const Smoothing found = smooth(model, Eigen::VectorXd::Constant(1, 1e-4), signal);
  double squares = 0, normalised = 0;
  for (std::size_t i = 0; i + 1 < truth.size(); ++i) {
    const double off = found.signal[0][static_cast<Eigen::Index>(i)] - truth[i];
    squares += off * off;
    normalised += std::pow(off / found.spread[0][static_cast<Eigen::Index>(i)], 2);
  }
  const auto count = static_cast<double>(truth.size() - 1);
  EXPECT_LT(std::sqrt(squares / count), 0.5);  // of a signal with standard deviation 1
  EXPECT_NEAR(normalised / count, 1, 0.25);
  EXPECT_NEAR(std::sqrt(found.q[0]), 0.01, 0.004);
}

// Steps of which the linear model says less than of the others are no process noise, though they miss much more.
TEST(FreeSignalFilter, WhatALinearModelLeavesOutIsNoProcessNoise) {
  StochasticModel model = scalar_model(0, 7);
  StochasticStretch& stretch = model.stretches[0];
  Random random(11);
  for (std::size_t i = 0; i + 1 < kRows; ++i) {
    if (i % 5 != 0) continue;
    const double jump = 0.1 * random.normal();
    stretch.bend[i][0] = 0.01;
    double left = jump;
    for (std::size_t k = i + 1; k < kRows; ++k, left *= 0.9) stretch.misfit[k][0] += 10 * left;
  }
  const auto settled = [](const StochasticModel& m) {
    Eigen::VectorXd q = Eigen::VectorXd::Constant(1, 1e-3);
    for (int i = 0; i < 300; ++i) q = smooth(m, q, {}).q;
    return std::sqrt(q[0]);
  };
  EXPECT_NEAR(settled(model), 0.01, 0.004);
  for (Eigen::VectorXd& bend : stretch.bend) bend.setZero();
  EXPECT_GT(settled(model), 0.02);
}

// A step that the model did not survive hides nothing of the others.
TEST(FreeSignalFilter, BeginsAnewAfterALostStep) {
  StochasticModel model = scalar_model(0, 6);
  StochasticStretch& stretch = model.stretches[0];
  stretch.lost[700] = 1;
  stretch.f[700].setZero();
  const double with = loss(model, 1e-4, {});
  EXPECT_TRUE(std::isfinite(with));
  EXPECT_NEAR(with, loss(scalar_model(0, 6), 1e-4, {}), 10);
}

double likeliest(const StochasticModel& model, double q, const FreeSignal& from) {
  double least = loss(model, q, from);
  for (const double level : {0.3, 1.0, 3.0})
    for (const double memory : {0.3, 1.0, 3.0}) {
      FreeSignal tried = from;
      tried.level *= level;
      tried.memory *= memory;
      least = std::min(least, loss(model, q, tried));
    }
  return least;
}

// The scan of all ports says what the filter says of each: of the one where the signal is, of the other, and of a
// recording without one.
TEST(SignalScan, AgreesWithTheFilter) {
  for (const double level : {0.3, 1.0}) {
    const StochasticModel model = scalar_model(level, 8);
    const std::vector<ScannedSignal> scanned = scan_signals(model, Eigen::VectorXd::Constant(1, 1e-4), 2);
    ASSERT_EQ(scanned.size(), 2u);
    for (const ScannedSignal& found : scanned) {
      const double exact = loss(model, 1e-4, {}) - likeliest(model, 1e-4, found.signal);
      EXPECT_NEAR(found.gain, exact, 0.35 * exact) << found.signal.port;
    }
  }
  const StochasticModel nothing = scalar_model(0, 9);
  for (const ScannedSignal& found : scan_signals(nothing, Eigen::VectorXd::Constant(1, 1e-4), 1))
    EXPECT_LT(found.gain, 5);
}

TEST(SignalScan, LeavesOutReadingsThatDoNotCount) {
  StochasticModel model = scalar_model(1, 10);
  for (std::size_t i = 300; i < 500; ++i) model.stretches[0].misfit[i][0] = std::nan("");
  for (const ScannedSignal& found : scan_signals(model, Eigen::VectorXd::Constant(1, 1e-4), 1)) {
    const double exact = loss(model, 1e-4, {}) - likeliest(model, 1e-4, found.signal);
    EXPECT_NEAR(found.gain, exact, 0.35 * exact) << found.signal.port;
  }
}

// With transducers far better than a rig's own, where the piston turns is what a linear model knows least of.
TEST(Discrepancy, IsSmallWhereDryFrictionTurnsToo) {
  Datasheet quiet = servo();
  for (Channel& channel : quiet.channels) channel.noise_std /= 5, channel.resolution /= 5;
  std::vector<SegmentedRun> runs;
  for (const std::uint64_t seed : {3u, 4u}) {
    runs.push_back(cut_run(quiet, "multisine", simulate(quiet, servo_setup("multisine", seed), 6), 0.25));
  }
  const ResidualModel residuals(quiet, std::move(runs));
  const Discrepancy found = find_discrepancy(residuals, {quiet.nominal(), {}}, {0, 1}, 2, Places::free);
  EXPECT_LT(found.places.front().gain, 0.01 * found.readings);
  EXPECT_LT(found.loss, 0.15 * found.readings);
}

ResidualModel driven_by(const std::string& effect) {
  std::vector<SegmentedRun> runs;
  for (const char* profile : {"multisine", "prbs"}) {
    SimulationSetup setup = servo_setup(profile, 3);
    if (!effect.empty()) setup.effects.push_back(parse_effect(effect));
    runs.push_back(cut_run(servo(), profile, simulate(servo(), setup, 6), 0.25));
  }
  return ResidualModel(servo(), std::move(runs));
}

TEST(Discrepancy, IsSmallWhereTheModelIsRight) {
  const ResidualModel residuals = driven_by("");
  const Discrepancy found = find_discrepancy(residuals, {servo().nominal(), {}}, {0, 1}, 2, Places::free);
  ASSERT_FALSE(found.places.empty());
  EXPECT_LT(found.places.front().gain, 0.1 * found.loss);
}

// At the place of what is missing a free signal wins most, and nothing much once the effect is in the model.
TEST(Discrepancy, ShowsThePlaceOfWhatIsMissing) {
  for (const auto& [effect, place] : std::vector<std::pair<std::string, std::string>>{
           {"clogging@restriction.valve:fraction=0.15", "restriction.valve"},
           {"offset@sensor.chamber_a_pressure:value=2e5", "sensor.chamber_a_pressure"},
           {"load_force@force.piston:constant=400", "force.piston"},
           {"orifice_leakage@flow.chamber_a_chamber_b:coefficient=1e-8", "flow.chamber_a_chamber_b"}}) {
    SCOPED_TRACE(effect);
    const ResidualModel residuals = driven_by(effect);
    const Discrepancy before = find_discrepancy(residuals, {servo().nominal(), {}}, {0, 1}, 2, Places::free);
    EXPECT_EQ(before.places.front().port, place);
    const Discrepancy after =
        find_discrepancy(residuals, {servo().nominal(), {parse_effect(effect)}}, {0, 1}, 2, Places::free);
    EXPECT_GT(before.loss - after.loss, 5 * after.places.front().gain);
    EXPECT_GT(before.loss - after.loss, before.places.front().gain);
  }
}

// Behind a slow sensor the position says as much of the velocity, which nothing else shows: undone row by row, from the
// slope of what is shown, the right model was less likely (.070) than the one without the lag (.064), per reading.
TEST(Discrepancy, KnowsWhatIsBehindASlowSensor) {
  const SimulationSetup rig = cylinder_off_nominal("multisine", 3);
  const EffectSpec lag = parse_effect("lag@sensor.position:time_constant=0.03");
  const auto loss = [&](const std::vector<EffectSpec>& there, const std::vector<EffectSpec>& modelled) {
    SimulationSetup setup = rig;
    setup.effects.insert(setup.effects.end(), there.begin(), there.end());
    std::vector<SegmentedRun> runs;
    runs.push_back(cut_run(cylinder(), "multisine", simulate(cylinder(), setup, 12), 0.5));
    const ResidualModel residuals(cylinder(), std::move(runs));
    const Discrepancy found = find_discrepancy(residuals, {rig.parameters, modelled}, {0}, 2, Places::none);
    return found.loss / found.readings;
  };
  const double with = loss({lag}, {lag});
  EXPECT_LT(with, loss({}, {}) + 0.015);
  EXPECT_LT(with, loss({lag}, {}) - 0.015);
}

// The oil columns of the hoses swing with the piston: left to go on along the recording they took half of what their
// effect wins.
TEST(Discrepancy, KnowsTheStatesThatAnEffectAdds) {
  const EffectSpec column = parse_effect("line_inertia@line.valve_cylinder:inertance=5e7");
  SimulationSetup setup = servo_setup("multisine", 3);
  setup.effects.push_back(column);
  std::vector<SegmentedRun> runs;
  runs.push_back(cut_run(servo(), "multisine", simulate(servo(), setup, 12), 0.25));
  const ResidualModel residuals(servo(), std::move(runs));
  const auto loss = [&](const std::vector<EffectSpec>& modelled) {
    return find_discrepancy(residuals, {servo().nominal(), modelled}, {0}, 2, Places::none).loss;
  };
  EXPECT_LT(loss({column}), 0.25 * loss({}));
}

// Of a run that is looked at in pieces each begins anywhere, and what a command's play remembers there is not what it
// is at first: the right model of one was twice as unlikely as none.
TEST(Discrepancy, FillsMemoriesAheadOfAPiece) {
  const EffectSpec play = parse_effect("hysteresis@command.bench_valve_command:width=0.035");
  SimulationSetup setup;
  setup.profile = "paper";
  setup.effects = {play};
  std::vector<SegmentedRun> runs;
  runs.push_back(cut_run(cooling(), "paper", simulate(cooling(), setup, 15), 0.25));
  ASSERT_GT(runs.front().segments(), 48u);  // more than are looked at
  const ResidualModel residuals(cooling(), std::move(runs));
  const auto loss = [&](const std::vector<EffectSpec>& modelled) {
    return find_discrepancy(residuals, {cooling().nominal(), modelled}, {0}, 2, Places::none).loss;
  };
  EXPECT_LT(loss({play}), 0.2 * loss({}));
}

// As it is recorded at a plant: 10 Hz, flapper and spool not measured.
Recording plant_recording(const SimulationSetup& setup, double duration) {
  const Recording all = simulate(valve(), setup, duration);
  Recording some;
  some.rig = all.rig;
  some.channels = all.channels;
  const std::size_t channels = all.channels.size();
  for (std::size_t k = 0; k < all.rows(); k += 10) {
    some.time.push_back(all.time[k]);
    some.sequence.push_back(k / 10);
    for (std::size_t c = 0; c < channels; ++c) some.values.push_back(all.at(k, c));
    for (const char* hidden : {"flapper_position", "spool_position"})
      some.values[some.values.size() - channels + valve_column(hidden)] = std::nan("");
  }
  return some;
}

// A flow that is stuck asks for openings that no valve has, where the model's derivatives are nonsense: followed there,
// the worst segment of these runs costs 1520 instead of 1012.
TEST(Discrepancy, DoesNotFollowAStuckSensorToWhereNoRigIs) {
  std::vector<SegmentedRun> runs;
  for (const char* profile : {"steps", "prbs"}) {
    SimulationSetup setup = off_nominal_valve(profile, 5);
    setup.effects.push_back(parse_effect("stuck@sensor.flow:from=10"));
    runs.push_back(cut_run(valve(), profile, plant_recording(setup, 30), 3.8));
  }
  const ResidualModel residuals(valve(), std::move(runs));
  const Discrepancy found = find_discrepancy(residuals, {valve().nominal(), {}}, {0, 1}, 2, Places::free);
  EXPECT_EQ(found.places.front().port, "sensor.flow");
  for (const double loss : found.losses) EXPECT_LT(loss, 1200);
}

// A tolerance of a third may not take a parameter through 0.
TEST(BoundedMove, KeepsTheSignOfAParameter) {
  const auto index = static_cast<std::size_t>(valve().parameter("spool_coulomb"));
  const Parameter& parameter = valve().parameters[index];
  ASSERT_GT(parameter.tolerance, 0.28);
  GapOptions::Linearisation options;
  const Eigen::VectorXd lowest = lowest_deviations(valve(), {index}, options);
  const Eigen::VectorXd z = Eigen::VectorXd::Constant(1, -1);
  const auto move = [&](double gradient) {
    return bounded_move(Eigen::MatrixXd::Identity(1, 1), Eigen::VectorXd::Constant(1, gradient), z, lowest, options)[0];
  };
  EXPECT_NEAR(1 + (z[0] + move(100)) * parameter.tolerance, 0.1, 1e-12);
  EXPECT_NEAR(z[0] + move(-100), options.parameter_bound_tolerances, 1e-12);
  EXPECT_NEAR(move(0.5), -0.5, 1e-12);
}

// Two that nearly make up for one another: held where the first is cut off, the other one goes where it is worse than
// before. The minimum within the bounds is another corner.
TEST(BoundedMove, IsTheLeastWithinTheBounds) {
  GapOptions::Linearisation options;
  const double bound = options.parameter_bound_tolerances;
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  for (int draw = 0; draw < 200; ++draw) {
    const Eigen::Index n = 6;
    Eigen::MatrixXd root(n, n);
    Eigen::VectorXd gradient(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      gradient[i] = 30 * normal(random);
      for (Eigen::Index k = 0; k < n; ++k) root(i, k) = (k > 3 ? 0.05 : 3) * normal(random);
    }
    Eigen::MatrixXd hessian = root * root.transpose();
    hessian.diagonal().array() += 0.1;
    const Eigen::VectorXd z = Eigen::VectorXd::Zero(4), lowest = Eigen::VectorXd::Constant(4, -bound);
    const Eigen::VectorXd move = bounded_move(hessian, gradient, z, lowest, options);
    const Eigen::VectorXd slope = hessian * move + gradient;
    for (Eigen::Index i = 0; i < n; ++i) {
      const double scale = std::sqrt(hessian(i, i));
      ASSERT_TRUE(i >= 4 || std::abs(move[i]) <= bound + 1e-12);
      if (i < 4 && move[i] >= bound)
        EXPECT_LT(slope[i], 0.01 * scale) << draw;
      else if (i < 4 && move[i] <= -bound)
        EXPECT_GT(slope[i], -0.01 * scale) << draw;
      else
        EXPECT_NEAR(slope[i], 0, 0.01 * scale) << draw;
    }
  }
}

GapEvidence evidence() {
  GapEvidence e;
  e.found = true;
  e.shrink = 0.8;
  e.perfect = 3000;
  e.effects = 2000;
  e.free_before = 1500;
  e.free_after = 50;
  e.readings = 10000;
  e.size = 0.1;
  e.excess = 3;
  e.calibrated = 1;
  return e;
}

TEST(Verdict, FollowsTheEvidence) {
  const GapOptions::Verdict options;
  const auto judge = [&](const GapEvidence& e) { return judge_gap(e, 0.01, options); };
  EXPECT_EQ(judge(evidence()).verdict, "named");
  EXPECT_TRUE(judge(evidence()).names);
  // What is left beside a name does not withdraw it.
  GapEvidence e = evidence();
  e.perfect = 8000;
  EXPECT_EQ(judge(e).verdict, "named");
  // What closes little of a large gap is a part, and not even that where the likelihood says too much.
  e = evidence();
  e.shrink = 0.55;
  EXPECT_EQ(judge(e).verdict, "named");
  e.shrink = 0.3;
  EXPECT_EQ(judge(e).verdict, "unknown");
  EXPECT_TRUE(judge(e).names);
  e.plain = false;
  EXPECT_FALSE(judge(e).names);
  EXPECT_NE(judge(e).verdict, "named");
  // What restarts hide may be unlikely from sample to sample where it closes all of a gap that is large; what they
  // leave as it is must not, nor what leaves something.
  e = evidence();
  e.effects = -2500;
  e.plain = false;
  e.shrink = e.shrink_low = 1;
  e.left = 0.01;
  e.quiet = 0.05;
  EXPECT_EQ(judge(e).verdict, "named");
  e.plain = true;
  EXPECT_NE(judge(e).verdict, "named");
  e.plain = false;
  e.left = 1.2;
  e.shrink = 0.93;
  EXPECT_NE(judge(e).verdict, "named");
  e.shrink = 0.97;
  EXPECT_EQ(judge(e).verdict, "named");
  // A signal at one place that would win much beside it does; the effect is then a part.
  e = evidence();
  e.free_after = 1000;
  EXPECT_EQ(judge(e).verdict, "unknown");
  EXPECT_TRUE(judge(e).names);
  // What wins next to nothing was not found, and no place wins much: silence.
  e = evidence();
  e.effects = 60;
  e.free_before = 100;
  EXPECT_EQ(judge(e).verdict, "miscalibrated");
  EXPECT_FALSE(judge(e).names);
  e.calibrated = 0;
  EXPECT_EQ(judge(e).verdict, "none");
  // Nothing found, but a place that would win much of a gap that matters.
  e = evidence();
  e.found = false;
  e.effects = 0;
  EXPECT_EQ(judge(e).verdict, "unknown");
  EXPECT_FALSE(judge(e).names);
  e.readings = 100000;
  EXPECT_EQ(judge(e).verdict, "miscalibrated");
  e.readings = 10000;
  e.size = 0.005;
  EXPECT_EQ(judge(e).verdict, "miscalibrated");
  e = evidence();
  e.found = false;
  e.effects = 0;
  e.excess = 0.5;
  EXPECT_EQ(judge(e).verdict, "miscalibrated");
}

}  // namespace
}  // namespace faultline

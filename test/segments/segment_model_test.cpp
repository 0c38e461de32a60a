// A model over segments: what is left where it is right, whatever sits at a sensor, whatever is missing.
#include "faultline/segments/segment_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include <Eigen/Cholesky>

#include "faultline/segments/linearisation.h"
#include "rigs/cooling_circuit/runs.h"
#include "rigs/hydraulic_drive/runs.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

struct Prepared {
  SegmentModel model{servo()};
  SegmentedRun run;
  std::vector<double> noise;
  Prepared(Recording recording, double segment) : run(cut_run(servo(), "run", std::move(recording), segment)) {
    noise = noise_of(servo(), {run});
    model.place_starts(run, noise, model.nominal());
  }
};

ModelChange nominal(const std::vector<EffectSpec>& effects = {}) { return {servo().nominal(), effects}; }

// The middle of an effect's range at a port. Not stuck, which has no size, nor quantisation: it rounds the model's
// value as well, which is noise again.
std::vector<EffectSpec> sensor_effects() {
  std::vector<EffectSpec> result;
  for (const Port& port : servo().ports) {
    if (port.kind != PortKind::sensor) continue;
    for (const FittingEffect& fitting : port.effects) {
      EffectSpec spec;
      spec.effect = fitting.effect;
      spec.port = port.name;
      if (spec.effect == "stuck" || spec.effect == "quantisation") continue;
      for (const EffectParameter& p : find_effect_type(spec.effect)->parameters) {
        const auto found = fitting.bounds.find(p.name);
        const Bounds b = found == fitting.bounds.end() ? Bounds{p.usual, p.usual} : found->second;
        spec.parameters.push_back(b.minimum > 0 ? std::sqrt(b.minimum * b.maximum) : 0.5 * b.maximum);
      }
      result.push_back(spec);
    }
  }
  return result;
}

// An encoder may be as fine as it likes: what a residual shows of a model that is far off is not cut in units of noise.
TEST(SegmentModel, KeepsResidualsThatAreLargeAgainstTheNoise) {
  Prepared prepared(simulate(servo(), servo_setup("multisine"), 2), 0.5);
  const ModelChange off = nominal({parse_effect("offset@sensor.load_pressure:value=3e6")});
  std::vector<double> quiet = prepared.noise;
  for (double& sigma : quiet) sigma *= 1e-4;
  const Eigen::MatrixXf usual = prepared.model.residuals(off, prepared.run, prepared.noise);
  const Eigen::MatrixXf fine = prepared.model.residuals(off, prepared.run, quiet);
  EXPECT_GT(fine.cwiseAbs().maxCoeff(), 1e6F);
  EXPECT_LT((1e-4F * fine - usual).cwiseAbs().maxCoeff(), 1e-3F * usual.cwiseAbs().maxCoeff());
}

// One sample after the states were put back to what the sensors show.
TEST(SegmentModel, LeavesNoiseWithAnyEffectAtASensor) {
  std::vector<EffectSpec> effects = sensor_effects();
  Datasheet sheet = servo();
  for (Port& port : sheet.ports)
    if (port.name == "sensor.velocity") port.effects.push_back({"gain_curve", {{"curvature", {-0.4, 0.4}}}});
  effects.push_back(parse_effect("gain_curve@sensor.velocity:curvature=0.3"));
  effects.push_back(parse_effect("lag@sensor.velocity:time_constant=0.02,second=0.3"));
  ASSERT_GT(effects.size(), 10u);
  for (const EffectSpec& effect : effects) {
    SimulationSetup setup = servo_setup("multisine");
    setup.effects = {effect};
    SegmentedRun run = cut_run(sheet, "run", simulate(sheet, setup, 3), 0.5);
    const SegmentModel model(sheet);
    const std::vector<double> noise = noise_of(sheet, {run});
    model.place_starts(run, noise, model.nominal());
    const Eigen::MatrixXf r = model.residuals(nominal({effect}), run, noise, 1);
    for (Eigen::Index o = 0; o < r.cols(); ++o)
      EXPECT_LT(std::sqrt(r.col(o).squaredNorm() / static_cast<float>(r.rows())), 1.4f)
          << to_string(effect) << " "
          << sheet.channels[static_cast<std::size_t>(model.outputs()[static_cast<std::size_t>(o)])].name;
  }
}

// Every effect that fits a sensor, of a size that the sensor plainly shows, on a state that is measured; the start
// states come back through it. Against the same run without it.
TEST(SegmentModel, StartsBehindAnyEffectAtASensor) {
  std::multimap<std::string, std::string> sizes = {{"deadband", "width=0.005"},
                                                   {"delay", "time=0.0123"},
                                                   {"drift", "rate=0.01"},
                                                   {"free_curve", "of=0,low=-0.1,high=0.1,v0=0.01,v8=-0.02"},
                                                   {"free_signal", "value=0.02"},
                                                   {"gain_curve", "curvature=0.3"},
                                                   {"hysteresis", "width=0.01"},
                                                   {"lag", "time_constant=0.02"},
                                                   {"lag", "time_constant=0.02,second=0.3"},
                                                   {"noise", "std=0.001"},
                                                   {"offset", "value=0.02"},
                                                   {"quantisation", "step=0.0005"},
                                                   {"rate_limit", "rate=0.3"},
                                                   {"saturation", "limit=0.05"},
                                                   {"scale", "factor=1.1"},
                                                   {"second_order_lag", "natural_frequency=200,damping=0.7"},
                                                   {"stuck", "from=1.5"}};
  const auto rms = [](const EffectSpec* effect, bool one_sample) {
    Datasheet sheet = servo();
    SimulationSetup setup = servo_setup("multisine");
    if (effect) {
      setup.effects = {*effect};
      FittingEffect fits{effect->effect, {}};
      for (const EffectParameter& p : find_effect_type(effect->effect)->parameters)
        fits.bounds[p.name] = {p.minimum, p.maximum};
      for (Port& port : sheet.ports)
        if (port.name == effect->port) port.effects = {fits};
    }
    SegmentedRun run = cut_run(sheet, "run", simulate(sheet, setup, 3), 0.25);
    const SegmentModel model(sheet);
    const std::vector<double> noise = noise_of(sheet);
    const ModelChange change{sheet.nominal(), setup.effects};
    model.place_starts(run, noise, change);
    if (!one_sample) model.settle(change, run, noise);
    const Eigen::MatrixXf r =
        one_sample ? model.residuals(change, run, noise, 1)
                   : settled(run, model.start_columns(change, run, noise), model.residuals(change, run, noise));
    std::vector<double> result;
    for (Eigen::Index o = 0; o < r.cols(); ++o)
      result.push_back(std::sqrt(r.col(o).squaredNorm() / static_cast<float>(r.rows())));
    return result;
  };
  for (const bool one_sample : {true, false}) {
    const std::vector<double> without = rms(nullptr, one_sample);
    for (const EffectType& type : effect_types()) {
      // A lag multiplies the noise of the slope from which its input is known: segments keep some of that.
      // What noise and rounding add, the model adds as well; in a zone a state shows nowhere and goes on by itself.
      if (!type.fits_kind(PortKind::sensor) || type.name == "noise" || type.name == "quantisation") continue;
      if (type.name == "deadband" && !one_sample) continue;
      const auto [first, last] = sizes.equal_range(type.name);
      ASSERT_NE(first, last) << type.name;
      for (const std::string port : {"sensor.position", "sensor.velocity"})
        for (auto size = first; size != last; ++size) {
          const EffectSpec spec = parse_effect(type.name + "@" + port + ":" + size->second);
          const std::vector<double> with = rms(&spec, one_sample);
          for (std::size_t o = 0; o < with.size(); ++o)
            EXPECT_LT(with[o], 1.15 * without[o] + 0.05)
                << to_string(spec) << " output " << o << (one_sample ? ", one sample" : ", segments");
        }
    }
  }
}

// Its reading drives the model, so what it forgets is turned back from what it shows around.
TEST(SegmentModel, AMemoryOfASensorThatDrivesTheModelIsTurnedBack) {
  for (const std::string effect :
       {"lag@sensor.pump_pressure:time_constant=0.03", "delay@sensor.pump_pressure:time=0.02"}) {
    SimulationSetup setup = drive_setup("paper");
    setup.noise = false;
    setup.effects = {parse_effect(effect)};
    SegmentedRun run = cut_run(drive(), "run", simulate(drive(), setup, 20), 0.5);
    const SegmentModel model(drive());
    const std::vector<double> noise = noise_of(drive());
    model.place_starts(run, noise, model.nominal());
    const double without = model.residuals(model.nominal(), run, noise).squaredNorm();
    const double with = model.residuals({drive().nominal(), setup.effects}, run, noise).squaredNorm();
    EXPECT_LT(with, 0.2 * without) << effect;
  }
}

// Segments that are left out change nothing in the others; a piece's first row counts, since nothing ends there.
TEST(SegmentModel, SomeSegmentsAreAsInTheWholeRun) {
  const Prepared whole(simulate(servo(), servo_setup("multisine"), 3), 0.25);
  const std::vector<std::size_t> which = {2, 3, 7};
  const SegmentedRun part = some_segments(whole.run, which);
  ASSERT_EQ(part.segments(), which.size());
  const Eigen::MatrixXf all = whole.model.residuals(nominal(), whole.run, whole.noise);
  const Eigen::MatrixXf some = whole.model.residuals(nominal(), part, whole.noise);
  const auto rows = static_cast<Eigen::Index>(whole.run.segment) - 1;
  for (const std::size_t g : which) {
    const auto first = static_cast<Eigen::Index>(whole.run.restarts[g]) + 1;
    EXPECT_TRUE(some.middleRows(first, rows) == all.middleRows(first, rows)) << "segment " << g;
  }
  EXPECT_EQ(some.topRows(static_cast<Eigen::Index>(whole.run.restarts[2])).squaredNorm(), 0.0f);
  const auto between = static_cast<Eigen::Index>(whole.run.restarts[4]);
  EXPECT_EQ(some.middleRows(between, 3 * (rows + 1)).squaredNorm(), 0.0f);
}

// How far pieces are, led in by so many segments, from what the whole run leaves there.
float off(const Datasheet& sheet, const ModelChange& change, const std::vector<double>& noise, const SegmentedRun& part,
          const Eigen::MatrixXf& all, std::size_t ahead) {
  SegmentOptions options;
  options.ahead_segments = ahead;
  const Eigen::MatrixXf own = SegmentModel(sheet, options).residuals(change, part, noise);
  float square = 0;
  for (const std::size_t restart : part.restarts) {
    const auto first = static_cast<Eigen::Index>(restart), rows = static_cast<Eigen::Index>(part.segment);
    square += (own.middleRows(first, rows) - all.middleRows(first, rows)).squaredNorm();
  }
  return square;
}

// Where the driven side stands in its play no reading says: what lies before a piece has to be run.
TEST(SegmentModel, PiecesAreLedIntoWhereTheModelRemembers) {
  const EffectSpec play = parse_effect("backlash@transmission.rod:gap=2e-3");
  SimulationSetup setup = servo_setup("multisine");
  setup.effects = {play};
  Prepared whole(simulate(servo(), setup, 8), 0.25);
  const std::vector<std::size_t> which = {6, 7, 15, 16, 24, 25};
  const SegmentedRun part = some_segments(whole.run, which);
  const Eigen::MatrixXf all = whole.model.residuals(nominal({play}), whole.run, whole.noise);
  const auto misses = [&](std::size_t ahead) { return off(servo(), nominal({play}), whole.noise, part, all, ahead); };
  EXPECT_LT(misses(SegmentOptions().ahead_segments), 0.001F * misses(0));
}

// Where no start puts a state back, what a smoother says of it at the beginning of a piece is not what the model itself
// would have made of it: effects that remember, which are led in, would win by that alone.
TEST(SegmentModel, PiecesAreLedIntoWhereStatesGoOn) {
  SimulationSetup setup = cooling_setup("paper");
  setup.effects = {parse_effect("heat_capacity@heat.t_wall:capacity=1000")};
  SegmentedRun run = cut_run(cooling(), "run", simulate(cooling(), setup, 30), 0.25);
  const std::vector<double> noise = noise_of(cooling(), {run});
  const SegmentModel placed(cooling());
  placed.place_starts(run, noise, placed.nominal());
  const SegmentedRun part = some_segments(run, {20, 21, 60, 61, 100, 101});
  const ModelChange change{cooling().nominal(), {}};
  const Eigen::MatrixXf all = placed.residuals(change, run, noise);
  const auto misses = [&](std::size_t ahead) { return off(cooling(), change, noise, part, all, ahead); };
  EXPECT_LT(misses(SegmentOptions().ahead_segments), 0.01F * misses(0));
}

// Long steps where the motion is even cost a fraction of the noise, with effects that remember what they saw too.
TEST(SegmentModel, LongStepsAreAsNear) {
  const Prepared given(simulate(servo(), servo_setup("multisine"), 3), 0.25);
  SegmentOptions options;
  options.long_steps = true;
  const SegmentModel longer(servo(), options);
  const auto residuals = [&](const SegmentModel& model, const char* effect) {
    ModelChange change = nominal();
    if (effect != nullptr) change.effects.push_back(parse_effect(effect));
    return model.residuals(change, given.run, given.noise);
  };
  const auto size = [](const Eigen::MatrixXf& r) { return std::sqrt(r.squaredNorm() / static_cast<float>(r.size())); };
  const Eigen::MatrixXf without = residuals(given.model, nullptr);
  for (const char* effect : {static_cast<const char*>(nullptr), "lag@sensor.position:time_constant=0.02",
                             "lag@sensor.velocity:time_constant=0.02", "hysteresis@sensor.load_pressure:width=1e5",
                             "lag@command.valve_command:time_constant=0.01"}) {
    const Eigen::MatrixXf near = residuals(longer, effect), exact = residuals(given.model, effect);
    EXPECT_GT(size(near - exact), 0.0f) << (effect ? effect : "nominal");
    EXPECT_LT(size(near - exact), 0.1f) << (effect ? effect : "nominal");
    if (effect) {
      EXPECT_GT(size(exact - without), 0.5f) << effect;  // it is there
    }
  }
}

TEST(SegmentModel, TakesNothingFromReadingsThatAreMissing) {
  Recording recording = simulate(servo(), servo_setup("multisine"), 3);
  Recording holes = recording;
  for (std::size_t k = 600; k < 700; ++k) holes.values[k * holes.columns() + column("velocity")] = std::nan("");
  for (std::size_t k = 1700; k < holes.rows(); ++k) holes.time[k] += 0.01;
  const Prepared whole(std::move(recording), 0.5), cut(std::move(holes), 0.5);
  EXPECT_EQ(cut.run.stretches.size(), 2u);
  const Eigen::MatrixXf r = settled(cut.run, cut.model.start_columns(nominal(), cut.run, cut.noise),
                                    cut.model.residuals(nominal(), cut.run, cut.noise));
  EXPECT_TRUE(r.allFinite());
  const auto velocity =
      std::find(cut.model.outputs().begin(), cut.model.outputs().end(), static_cast<int>(column("velocity"))) -
      cut.model.outputs().begin();
  EXPECT_EQ(r.col(velocity).segment(600, 100).squaredNorm(), 0);
  double square = 0, counted = 0;
  for (std::size_t g = 0; g < cut.run.segments(); ++g) {
    square += static_cast<double>(
        r.middleRows(static_cast<Eigen::Index>(cut.run.restarts[g]), static_cast<Eigen::Index>(cut.run.segment))
            .squaredNorm());
    counted += cut.run.counted[g];
  }
  EXPECT_NEAR(square / counted, 1, 0.1);
}

// At the beginning of a run there is no model yet that could go on.
TEST(SegmentModel, StartsWhereAReadingIsMissingFromThoseBesideIt) {
  const Recording recording = simulate(servo(), servo_setup("multisine"), 3);
  Recording late;  // begins in the middle of a motion
  late.rig = recording.rig;
  late.channels = recording.channels;
  for (std::size_t k = 700; k < recording.rows(); ++k) late.append(recording.sample(k));
  const Prepared whole(late, 0.5);
  for (const std::size_t missing : {1u, 5u}) {
    Recording holes = late;
    for (std::size_t k = 0; k < missing; ++k)
      for (const char* name : {"position", "velocity", "chamber_a_pressure"}) {
        holes.values[k * holes.columns() + column(name)] = std::nan("");
        holes.values[(500 + k) * holes.columns() + column(name)] = std::nan("");
      }
    const Prepared cut(std::move(holes), 0.5);
    for (const std::size_t segment : {0u, 1u})
      for (Eigen::Index s = 0; s < 4; ++s) {
        ASSERT_TRUE(std::isfinite(cut.run.starts[segment][s])) << s;
        const double root = whole.run.start_roots[segment].row(s).norm();
        EXPECT_NEAR(cut.run.starts[segment][s], whole.run.starts[segment][s], 3 * root) << s;
        EXPECT_LT(cut.run.start_roots[segment].row(s).norm(), 10 * root) << s;
      }
  }
}

TEST(SegmentModel, ARunOfAnotherPeriodIsAsGood) {
  const Recording recording = simulate(servo(), servo_setup("multisine"), 4);
  Recording slow;
  slow.rig = recording.rig;
  slow.channels = recording.channels;
  SimulationSetup held = servo_setup("multisine");
  for (std::size_t k = 0; k < recording.rows(); ++k)
    if (k % 2 == 0) slow.append(recording.sample(k));
  const Prepared run(std::move(slow), 0.5);
  const Eigen::MatrixXf r = settled(run.run, run.model.start_columns(nominal(), run.run, run.noise),
                                    run.model.residuals(nominal(), run.run, run.noise));
  // The command changed between the rows, too: not noise, but near.
  EXPECT_LT(r.squaredNorm() / static_cast<float>(r.size()), 6);
}

// Readings at the end of a range: a model beyond it is not wrong.
TEST(SegmentModel, ABoundCountsOnTheInsideOnly) {
  Datasheet sheet = servo();
  const std::size_t position = column("position");
  const Recording recording = simulate(servo(), servo_setup("multisine"), 2);
  double highest = -1;
  for (std::size_t k = 0; k < recording.rows(); ++k) highest = std::max(highest, recording.at(k, position));
  sheet.channels[position].maximum = 0.5 * highest;
  Recording bounded = recording;
  bounded.channels = sheet.channels;
  std::size_t at_bound = 0;
  for (std::size_t k = 0; k < bounded.rows(); ++k) {
    double& value = bounded.values[k * bounded.columns() + position];
    at_bound += value >= 0.5 * highest;
    value = std::min(value, 0.5 * highest);
  }
  ASSERT_GT(at_bound, 100u);
  SegmentedRun run = cut_run(sheet, "run", bounded, 0.5);
  const SegmentModel model(sheet);
  const std::vector<double> noise = noise_of(sheet, {run});
  model.place_starts(run, noise, model.nominal());
  const Eigen::MatrixXf r =
      settled(run, model.start_columns(nominal(), run, noise), model.residuals(nominal(), run, noise));
  const auto output =
      std::find(model.outputs().begin(), model.outputs().end(), static_cast<int>(position)) - model.outputs().begin();
  EXPECT_LT(r.col(output).squaredNorm() / static_cast<float>(r.rows()), 1.3f);
}

TEST(StartProjection, IsTheMarginalLikelihoodOverTheStart) {
  const Prepared p(simulate(servo(), servo_setup("prbs"), 0.2), 0.04);
  const Eigen::MatrixXf r = p.model.residuals(nominal(), p.run, p.noise);
  const double values = static_cast<double>(p.run.segment * p.model.outputs().size());
  SegmentedRun shifted = p.run;
  shifted.start_shift[1].setConstant(0.7);
  const StartProjection starts(p.run, p.model.start_columns(nominal(), p.run, p.noise), values);
  const Eigen::MatrixXd s = [&] {
    Eigen::MatrixXd all(static_cast<Eigen::Index>(values), static_cast<Eigen::Index>(starts.columns().size()));
    for (Eigen::Index i = 0; i < all.cols(); ++i)
      for (Eigen::Index o = 0; o < r.cols(); ++o)
        all.col(i).segment(o * 40, 40) =
            starts.columns()[static_cast<std::size_t>(i)].col(o).segment(40, 40).cast<double>();
    return all;
  }();
  Eigen::VectorXd column(s.rows());
  for (Eigen::Index o = 0; o < r.cols(); ++o) column.segment(o * 40, 40) = r.col(o).segment(40, 40).cast<double>();
  const Eigen::VectorXd moved = column - s * shifted.start_shift[1];
  const Eigen::MatrixXd covariance = Eigen::MatrixXd::Identity(s.rows(), s.rows()) + s * s.transpose();
  const double direct = moved.dot(covariance.llt().solve(moved));
  EXPECT_NEAR(starts.residual(shifted, r, 1).squaredNorm(), direct, 1e-3 * direct);
}

}  // namespace
}  // namespace faultline

// The options of all engines: every member is visited, by a name of its own, and is a sensible number; a changed one
// reaches its engine.
#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <string>

#include "faultline/estimators/response_settings.h"
#include "faultline/fit/fit_options.h"
#include "faultline/gap/diagnose_gap.h"
#include "faultline/gap/live_gap.h"
#include "faultline/isolation/signature_options.h"
#include "rigs/cooling_circuit/runs.h"

namespace faultline {
namespace {

struct Visited {
  std::set<std::string> names;
  std::size_t bytes = 0;
};

void check_value(double value) { EXPECT_TRUE(std::isfinite(value) && value != 0) << value; }
void check_value(std::size_t value) { EXPECT_GE(value, 1u); }
template <class Values>
void check_value(const Values& values) {
  EXPECT_FALSE(values.empty());
  for (const auto& value : values) check_value(value);
}

template <class Options>
Visited visit(Options& options) {
  Visited visited;
  for_each_option(options, [&](const char* name, auto& value) {
    EXPECT_TRUE(visited.names.insert(name).second) << name;
    visited.bytes += sizeof value;
    SCOPED_TRACE(name);
    check_value(value);
  });
  return visited;
}

// All members are of eight bytes or arrays of such, so that none that is forgotten hides in padding.
TEST(Options, EveryMemberIsVisited) {
  constexpr std::size_t kSwitch = 8;  // SegmentOptions::long_steps, which is no number, with its padding
  GapOptions gap;
  EXPECT_EQ(visit(gap).bytes, sizeof gap - kSwitch);
  FitOptions fit;
  EXPECT_EQ(visit(fit).bytes, sizeof fit - kSwitch);
  SegmentOptions segments;
  EXPECT_EQ(visit(segments).bytes, sizeof segments - kSwitch);
  LiveGapSettings live;
  EXPECT_EQ(visit(live).bytes, sizeof live - sizeof live.gap);
  ResponseSettings responses;
  EXPECT_EQ(visit(responses).bytes, sizeof responses - kSwitch - sizeof(double));  // jobs, of which no answer depends
}

TEST(Options, OfTheSignatureIsolatorAreTheDatasheets) {
  const StageSpec& spec = cooling().isolators.front();
  SignatureOptions options = read_signature_options(spec.settings, {"tube", "valve"}, cooling().sample_period);
  EXPECT_EQ(visit(options).bytes, sizeof options);
  EXPECT_EQ(options.change, (std::vector<double>{0.005, 0.01}));
  EXPECT_EQ(options.confirm_samples, 8u);
  EXPECT_EQ(options.rival_chi_squared, 9);
}

TEST(Options, OfTheFaultResponsesAreTheDatasheets) {
  for (const StageSpec& stage : servo().estimators) {
    if (stage.type != "fault_response") continue;
    const ResponseSettings settings = read_response_settings(stage.settings, servo());
    EXPECT_EQ(settings.threshold_evidence, 15);
    EXPECT_DOUBLE_EQ(settings.stretch_s(), 0.5);
  }
}

TEST(Options, ReachTheirStages) {
  GapOptions options;
  options.segments.start_prior_sigma = 5;
  options.linearisation.parameter_bound_tolerances = 0.25;
  options.candidates.stuck_times = 7;
  SimulationSetup setup = servo_setup("prbs");
  setup.parameters = servo().nominal();
  setup.parameters[static_cast<std::size_t>(servo().parameter("viscous_damping"))] *= 1.3;
  const auto prepared = [&] { return cut_run(servo(), "run", simulate(servo(), setup, 1), 0.25); };
  ModelChange nominal;
  nominal.parameters = servo().nominal();
  const ResidualModel residuals(servo(), {prepared()}, options), usual(servo(), {prepared()});
  EXPECT_NEAR((residuals.runs()[0].start_roots[0] - 2.5 * usual.runs()[0].start_roots[0]).norm(), 0, 1e-9);
  const Linearisation linear(residuals, nominal, {0}, 1);
  const FitResult fit = fit_gap(residuals, nominal, {}, linear, 4);
  EXPECT_NEAR(deviations(servo(), linear.free_parameters(), fit.model.parameters).cwiseAbs().maxCoeff(), 0.25, 1e-9);
  for (const Candidate& candidate : candidates(servo(), {}, 60, options.candidates)) {
    if (candidate.family != "stuck") continue;
    EXPECT_EQ(starting_points(candidate, options.candidates).size(), 7u);
    EXPECT_EQ(starting_points(candidate).size(), 12u);
  }
}

}  // namespace
}  // namespace faultline

// The branch observer: its Jacobians against central differences, its exact step against the equation integrated.
#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "estimators/jacobians.h"
#include "faultline/numerics/random.h"
#include "rigs/cooling_circuit/runs.h"

namespace faultline {
namespace {

Settings branch_settings(const std::string& scheme) {
  return {"test",
          {{"smallest_flow", 0.05},
           {"flow_noise", 0.003},
           {"inlet_noise", 1000},
           {"outlet_noise", 1000},
           {"pressure_walk", 100},
           {"coefficient_walk", 1e-5},
           {"initial_spread", 0.1}},
          {},
          {{"scheme", scheme}, {"residual", "before"}}};
}

TEST(Jacobian, CoolingBranches) {
  // Short steps too, in which the pressure has not settled yet: there every term of the exact step counts.
  for (const std::string scheme : {"euler", "exact"})
    for (const double dt : {1e-3, 1e-5, 2e-6}) {
      const auto model = make_process_model("cooling_branches", cooling(), branch_settings(scheme));
      Random random(5);
      for (int k = 0; k < 100; ++k) {
        std::vector<double> channels(cooling().channels.size(), 0), x, scale;
        for (const std::string& b : cooling().branches) {
          const double c = b == "t" ? 0.0018 : 0.0042, volume = b == "t" ? 5e-11 : 4.4e-11;
          const double q = random.uniform(0.3, 2.2), p1 = random.uniform(1e6, 5e6),
                       d = c / volume * random.uniform(0.8, 1.2);
          const double drop = std::pow(std::pow(q, 0.875) / (d * volume), 2) * random.uniform(0.5, 1.5);
          channels[static_cast<std::size_t>(cooling().channel(b + "_mass_flow"))] = q;
          channels[static_cast<std::size_t>(cooling().channel(b + "_inlet_pressure"))] = p1;
          channels[static_cast<std::size_t>(cooling().channel(b + "_outlet_pressure"))] = p1 - drop;
          x.insert(x.end(), {p1 - drop, d});
          scale.insert(scale.end(), {drop, d});
        }
        model->take_inputs(channels.data());
        ASSERT_LT(worst_entry(*model, x, scale, dt), 2e-5) << scheme << " " << dt << " " << k;

        // G, by differences of the inputs themselves.
        const std::size_t inputs = 2 * cooling().branches.size();
        std::vector<double> g(x.size() * inputs);
        model->input_jacobian(x.data(), dt, g.data());
        for (std::size_t b = 0; b < cooling().branches.size(); ++b)
          for (const std::size_t which : {std::size_t{0}, std::size_t{1}}) {
            const int channel =
                cooling().channel(cooling().branches[b] + (which == 0 ? "_mass_flow" : "_inlet_pressure"));
            const double step = which == 0 ? 1e-6 : 1.0;
            double next[2][kMaximumStates];
            for (int side = 0; side < 2; ++side) {
              std::vector<double> moved = channels;
              moved[static_cast<std::size_t>(channel)] += side == 0 ? step : -step;
              model->take_inputs(moved.data());
              model->predict(x.data(), dt, next[side]);
            }
            const double numeric = (next[0][2 * b] - next[1][2 * b]) / (2 * step);
            ASSERT_NEAR(g[2 * b * inputs + 2 * b + which], numeric, 1e-4 * std::max(std::abs(numeric), 1e-3))
                << scheme << " " << dt << " " << which;
          }
        model->take_inputs(channels.data());
      }
    }
}

TEST(CoolingBranches, ExactStepIsTheEquationIntegrated) {
  const auto exact = make_process_model("cooling_branches", cooling(), branch_settings("exact"));
  const auto euler = make_process_model("cooling_branches", cooling(), branch_settings("euler"));
  std::vector<double> channels(cooling().channels.size(), 0), x;
  for (const std::string& b : cooling().branches) {
    channels[static_cast<std::size_t>(cooling().channel(b + "_mass_flow"))] = 1.6;
    channels[static_cast<std::size_t>(cooling().channel(b + "_inlet_pressure"))] = 4.5e6;
    channels[static_cast<std::size_t>(cooling().channel(b + "_outlet_pressure"))] = 4.0e6;
    x.insert(x.end(), {4.0e6, b == "t" ? 3.6e7 : 9.5e7});
  }
  exact->take_inputs(channels.data());
  euler->take_inputs(channels.data());
  double whole[kMaximumStates];
  exact->predict(x.data(), 2e-5, whole);
  std::vector<double> fine = x, next(x.size());
  for (int k = 0; k < 20000; ++k) {
    euler->predict(fine.data(), 1e-9, next.data());
    fine = next;
  }
  for (std::size_t b = 0; b < 5; ++b) EXPECT_NEAR(whole[2 * b], fine[2 * b], 30) << b;  // of some 100 kPa that it moved
}

}  // namespace
}  // namespace faultline

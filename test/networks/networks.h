// Networks and runs that the tests of this folder share.
#pragma once

#include <cmath>
#include <string>

#include "faultline/networks/training.h"
#include "faultline/numerics/random.h"

namespace faultline {

// Inputs u (plain) and w (.smooth), outputs a and b.
inline Datasheet plant() {
  Datasheet sheet;
  sheet.rig = "plant";
  sheet.sample_period = 0.01;
  for (const char* name : {"u", "w", "a", "b"}) {
    Channel c;
    c.name = name;
    c.unit = "V";
    c.minimum = -100;
    c.maximum = 100;
    sheet.channels.push_back(c);
  }
  return sheet;
}

using Words = std::map<std::string, std::string>;
using Numbers = std::map<std::string, double>;

inline Settings black_box(const std::string& feedback, double lags = 2, double hidden = 3) {
  return Settings("test", Numbers{{"lags", lags}, {"hidden", hidden}}, {},
                  Words{{"inputs", "u, w"}, {"outputs", "a, b"}, {"feedback", feedback}, {"weights", "none"}});
}

inline Settings structured(const std::string& feedback, double hidden = 3) {
  return Settings("test", Numbers{{"hidden", hidden}, {"a_gain", 0.4}, {"cut_off", 5}}, {},
                  Words{{"inputs", "u, w, w.smooth, w.rate"},
                        {"outputs", "a, b"},
                        {"feedback", feedback},
                        {"a_sum", "u, w, a, b"},
                        {"a_beside", "w.rate, w.smooth"},
                        {"b_sum", "u, a, b"},
                        {"b_beside", "u, b"},
                        {"weights", "none"}});
}

// Smooth inputs, and outputs of a stable plant that is not linear.
inline std::vector<NetworkRun> runs_of(const NetworkShape& shape, int samples, std::uint64_t seed) {
  Random random(seed);
  NetworkRun run;
  run.inputs.resize(static_cast<Eigen::Index>(shape.inputs.size()), samples);
  run.outputs.setZero(static_cast<Eigen::Index>(shape.outputs.size()), samples);
  for (Eigen::Index i = 0; i < run.inputs.rows(); ++i) {
    double x = 0;
    for (Eigen::Index k = 0; k < samples; ++k) run.inputs(i, k) = x = 0.9 * x + 0.4 * random.normal();
  }
  for (Eigen::Index k = 1; k < samples; ++k) {
    const double a = run.outputs(0, k - 1), b = run.outputs(1, k - 1);
    run.outputs(0, k) = a + 0.2 * (std::tanh(run.inputs(0, k)) - a + 0.3 * b);
    run.outputs(1, k) = b + 0.3 * (0.5 * run.inputs(1, k) - b - 0.3 * std::tanh(a));
  }
  return {run};
}

}  // namespace faultline

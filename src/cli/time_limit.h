// The option --minutes of searches that may take long: after it they end with what they have.
#pragma once

#include <chrono>
#include <functional>
#include <string>

#include "cli/options.h"

namespace faultline {

inline void add_minutes(CLI::App& app, double& minutes, const std::string& meaning) {
  app.add_option("--minutes", minutes, meaning)->check(number_between(1e-3, 1e4));
}

// True once `minutes` from now have passed; never with 0.
inline std::function<bool()> time_limit(double minutes) {
  if (!(minutes > 0)) return {};
  const auto begun = std::chrono::steady_clock::now();
  return [begun, minutes] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count() > 60 * minutes;
  };
}

}  // namespace faultline

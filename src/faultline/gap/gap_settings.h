// What the gap diagnosis is asked with.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "faultline/gap/fit_gap.h"
#include "faultline/gap/gap_options.h"
#include "faultline/gap/gap_result.h"

namespace faultline {

struct GapSettings {
  std::vector<std::string> without;  // candidates to leave out
  int jobs = 1;
  std::uint64_t seed = 1;
  int most_effects = 3;
  double matters = 0.01;  // gap over what the channels move from which it must have a cause: judge_gap()
  GapOptions options;     // of the method; no user changes them
};

// Called from several threads; what it throws ends the diagnosis and is thrown on.
using GapProgress = std::function<void(double done, const std::string& text)>;

}  // namespace faultline

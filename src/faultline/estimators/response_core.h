// Names of the quantities by which the stage `fault_response` tells what it found, for whoever reads its estimates: `evidence`, `since`
// and `judged` (s, how long ago the fault began to show, and how long ago the last stretch ended), and for each place k in the ranking `first_k` and `second_k` (value: amplitude, std: its standard error; unit: effect@port of the
// hypothesis is not in a quantity, its number in fault_hypotheses() is the value of `first_k_hypothesis`) and their evidence.
#pragma once

#include <string>

namespace faultline {

constexpr int kRankedFirst = 6;
constexpr int kRankedSecond = 3;

inline std::string ranked_name(bool second, int place, const char* what) {
  return (second ? "second_" : "first_") + std::to_string(place) + "_" + what;
}

}  // namespace faultline

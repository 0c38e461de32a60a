// Thresholds of detectors for a stated rate of false alarms, and what they cost in delay.
//
// A detector alarms where its criterion stays above the threshold for `minimum_time`. The largest sustained criterion
// in each block of a healthy recording follows a Gumbel distribution, fitted by its probability-weighted moments b_0,
// b_1 (Hosking, Wallis, Wood, Technometrics 27, 1985):
//   sigma = (2 b_1 - b_0)/ln 2,  mu = b_0 - 0.5772 sigma,   threshold(rate) = mu - sigma ln(rate * block)
// Extrapolates beyond what was recorded: the 90 % upper bound from a bootstrap over blocks says how far that can be
// trusted. Assumes blocks that are alike and longer than the criterion's memory; at least eight of them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "faultline/rig/simulator.h"

namespace faultline {

struct Gumbel {
  double location = 0, scale = 0;
  double level(double rate, double block) const;  // exceeded `rate` times per s, in blocks of `block` s
};
Gumbel fit_gumbel(std::vector<double> maxima);

struct Threshold {
  std::string detector, setting;
  double set = 0;                // as in the datasheet
  double chosen = 0, upper = 0;  // for the wanted rate; with its 90 % upper bound
  double offset = 0;             // the setting is offset + chosen
  double rate_as_set = 0;        // false alarms per hour that the threshold of the datasheet gives, by the same fit
  std::size_t blocks = 0;
};

// For every detector of the stage that has a threshold. `rate` per hour, `block` s. Healthy runs that never show any of
// what a detector watches say nothing of its threshold: it stays as it is.
std::vector<Threshold> tune_thresholds(const Datasheet& sheet, const StageSpec& stage,
                                       const std::vector<Recording>& healthy, double rate, double block);

// A faulty run and when the fault begins.
struct FaultyRun {
  Recording recording;
  double onset = 0;  // s
};

struct TradeOff {              // one setting of the random walk, one rate
  double factor = 1;           // on the entry of Q
  double value = 0;            // that entry
  double rate = 0;             // false alarms per hour
  double threshold = 0;        // of the detector
  std::vector<double> delays;  // s, one per faulty run; NaN: not found, or found before it began
};

// Delay of `detector` against false alarms, with entry `state` of process_noise times each of `factors`.
std::vector<TradeOff> trade_off(const Datasheet& sheet, const StageSpec& stage, const std::string& detector,
                                std::size_t state, const std::vector<double>& factors, const std::vector<double>& rates,
                                const std::vector<Recording>& healthy, const std::vector<FaultyRun>& faulty,
                                double block);

}  // namespace faultline

// What an estimator says about one sample: state with covariance, innovation, and quantities derived from them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace faultline {

enum class ChannelStatus : std::uint8_t {
  good = 0,
  missing = 1,       // NaN or infinite
  out_of_range = 2,  // outside what the transducer can show
};

struct Quantity {
  std::string name;
  std::string unit;
  double value = 0;
  double std = 0;  // one sigma, of the estimate; 0 where it is a plain measurement
};

struct Estimate {
  double time = 0;  // s
  std::uint64_t sequence = 0;
  bool restarted = false;              // the estimator began anew with this sample (first sample, time jump, long gap)
  std::vector<double> state;           // in the model's units
  std::vector<double> covariance;      // states x states, row after row
  std::vector<double> innovation;      // measured minus predicted, in the model's units; 0 where not observed
  std::vector<double> innovation_std;  // predicted standard deviation of each
  double normalised_innovation = 0;    // innovation' S^-1 innovation over the observed rows
  int observed = 0;                    // how many rows were used
  std::vector<ChannelStatus> channel_status;  // one per channel of the rig
  std::vector<Quantity> quantities;
};

}  // namespace faultline

// A sample: one instant of all channels of a rig. A recording: a run of samples.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "faultline/signal/channel.h"

namespace faultline {

struct Sample {
  double time = 0;             // s, from the DAQ's clock
  std::uint64_t sequence = 0;  // counts up by one per sample at the DAQ
  std::vector<double> values;  // SI, in the order of the rig's channels; NaN: missing
};

struct Recording {
  std::string rig;
  std::vector<Channel> channels;
  std::vector<double> time;             // s, one per row
  std::vector<std::uint64_t> sequence;  // one per row
  std::vector<double> values;           // rows x channels, row after row

  std::size_t rows() const { return time.size(); }
  std::size_t columns() const { return channels.size(); }
  double at(std::size_t row, std::size_t column) const { return values[row * columns() + column]; }
  const double* row(std::size_t row) const { return values.data() + row * columns(); }

  void append(const Sample& sample);
  Sample sample(std::size_t row) const;
};

}  // namespace faultline

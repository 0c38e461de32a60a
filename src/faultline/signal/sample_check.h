// Looks at a run of samples as it comes and counts what is wrong with it: gaps, samples lost by the DAQ's own count,
// time that runs backwards or stands still, numbers that are missing. With dt the time from one sample to the next and
// T the period:
//   gap: dt > 1.5 T;   duplicate: dt = 0;   backward: dt < 0;   period: the median of the first 1000 positive dt.
// Times of samples are those of the DAQ; nothing here reads a clock.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "faultline/signal/sample.h"

namespace faultline {

struct SampleFindings {
  std::uint64_t samples = 0;
  std::uint64_t gaps = 0;
  double longest_gap = 0;  // s
  double first_gap = 0;    // s, time of the sample before it
  std::uint64_t lost = 0;  // by the sequence numbers
  std::uint64_t duplicates = 0;
  std::uint64_t backward = 0;
  double first_backward = 0;  // s, time of the sample that came too late
  std::uint64_t missing = 0;  // numbers that are NaN or infinite
  double period = 0;          // s; 0 if there are fewer than two samples
};

class SampleCheck {
 public:
  explicit SampleCheck(double period) : period_(period) {}

  void add(const Sample& sample);
  SampleFindings findings() const;

 private:
  double period_;
  double last_time_ = 0;
  std::uint64_t last_sequence_ = 0;
  std::vector<double> steps_;
  SampleFindings findings_;
};

// One line for each thing that is wrong; times counted from `start` [s]. Empty if all is well.
std::vector<std::string> describe(const SampleFindings& findings, double period, double start);

// Whether samples come at the period they should, within 1 %.
bool period_fits(const SampleFindings& findings, double period);

}  // namespace faultline

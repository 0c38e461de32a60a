// Whether a live stream of samples is what its source promises, by stamps and sequence numbers alone: stamps of zero
// or that stand still, numbers that do not count up one by one, another rate than the datasheet's, jitter. Judged over
// a window of samples at a time (ten seconds, but at least 10 and at most 100 samples), so that a trouble that is over
// is not told. With T the period, dt the step of the stamps per step of the numbers, and m its mean over the window
// (pauses of more than five medians left out):
//   zero, standing still, not counting: more than half of the samples
//   counting down, jumping about: numbers that fall while stamps rise, in more than a tenth of the steps; down if more
//   than half of them are alike
//   counting by n > 1: the median of the numbers' steps, where that of the stamps' is T within T/4; half must be alike
//   jitter: |dt - m| > T/4 for more than a tenth
//   rate: |m - T| > 1 % of T where there is no jitter, else > T/4
// Losses, disorder and restarts are counted by sequence_monitor.h, recordings are checked by sample_check.h.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace faultline {

class StreamWatch {
 public:
  explicit StreamWatch(double period);

  void add(std::uint64_t sequence, double stamp);          // stamp: s
  const std::string& trouble() const { return trouble_; }  // one line; empty if all is well

 private:
  // Of one sample after the one before, whose stamp it follows.
  struct Step {
    double stamp, number;  // s, 1
  };
  std::string judge();
  std::string judge_numbers() const;

  double period_;
  std::size_t window_;
  bool any_ = false;
  double last_stamp_ = 0;
  std::uint64_t last_sequence_ = 0;
  std::size_t samples_ = 0, zero_ = 0, still_ = 0, not_counting_ = 0;
  std::vector<Step> steps_;
  std::string trouble_;
};

}  // namespace faultline

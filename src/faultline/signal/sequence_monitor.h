// What happened to samples on their way: counted from their sequence numbers, stamps and, where known, arrival times.
//
// A DAQ numbers its samples s = s0, s0 + 1, ... and stamps them with its own clock, T apart. With h the highest number
// seen since the DAQ began, t_h its stamp, and W the window (in samples) over which disorder is believed:
//   lost          numbers between h and a higher s; taken back when such a number arrives after all
//   out of order  s < h within W, not seen before: arrived after a later one
//   duplicate     s <= h within W, seen before
//   restart       the DAQ began anew: s more than W below h; or s <= h with a stamp that the old numbering does not
//                 explain, |t - (t_h - (h - s) T)| > tolerance; or s > h with a stamp before t_h; or s more than W
//                 above
//                 h in less than half the time that so many samples take. Everything seen is forgotten, the counts
//                 stay; nothing counts as lost.
//   late          whatever its number: arrived more than `late_after` behind the DAQ's pace. With a the arrival by some
//                 clock that runs evenly, the pace is the least a - t of the recent past, let rise by `drift` seconds
//                 per second, since two clocks never agree. Not judged where the arrival is not known (NaN).
// Only in-order samples and restarts are worth passing on (`fit`): duplicates say nothing new, and an estimator cannot
// go back.
// Assumes: T constant within the tolerance. Fails: a DAQ that restarts within its first W samples with the very same
// stamps looks like duplicates until it passes h; a loss that spans a restart is not counted.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

namespace faultline {

struct SequenceCounts {
  std::uint64_t received = 0, lost = 0, duplicate = 0, out_of_order = 0, late = 0, restarts = 0;
};

struct SequenceSettings {
  double period = 1e-3;         // T [s]
  double tolerance = 0;         // of a stamp against its number [s]; 0: half a period, at least 1 ms
  double late_after = 0.05;     // s
  double drift = 2e-4;          // s per s that the two clocks may part
  std::uint64_t window = 1000;  // W, samples
};

enum class Arrival { first, in_order, after_loss, out_of_order, duplicate, restart };

// Whether a sample that arrived like this is to be passed on.
inline bool fit(Arrival arrival) { return arrival != Arrival::out_of_order && arrival != Arrival::duplicate; }

class SequenceMonitor {
 public:
  // Throws InputError for a period, tolerance, lateness or window that makes no sense.
  explicit SequenceMonitor(const SequenceSettings& settings);

  // `stamp`: s, DAQ's clock. `arrival`: s, of the clock that the receiver watches.
  Arrival observe(std::uint64_t sequence, double stamp, double arrival = std::numeric_limits<double>::quiet_NaN());
  void reset();  // forgets everything, counts too
  const SequenceCounts& counts() const { return counts_; }
  bool last_was_late() const { return late_; }

 private:
  void begin(std::uint64_t sequence, double stamp);
  void judge_pace(double stamp, double arrival);
  bool seen(std::uint64_t sequence) const { return seen_[sequence % seen_.size()] == sequence + 1; }
  void mark(std::uint64_t sequence) { seen_[sequence % seen_.size()] = sequence + 1; }

  SequenceSettings settings_;
  std::vector<std::uint64_t> seen_;  // ring: sequence + 1 of the sample that took the place; 0: none
  bool running_ = false;
  std::uint64_t first_ = 0, highest_ = 0;
  double highest_stamp_ = 0;
  bool paced_ = false, late_ = false;
  double pace_ = 0, pace_stamp_ = 0;
  SequenceCounts counts_;
};

}  // namespace faultline

// Tells the samples of two senders on one channel apart, where nothing but number and stamp says whose a sample is. A
// sender is a line: its numbers count up by one, its stamps T apart. A sample goes on with a line when its number is at
// most W from the line's last and its stamp is within the tolerance of what the line says for that number.
//
// A sample that goes on with no line begins one, and that one counts from then on: the source began anew, or a second
// one came. A source that began anew does not go on with its old line. When the line of before goes on all the same,
// both having had 10 samples, there are two senders: the older line counts, and samples of the other are not `own`, as
// long as the older one sends. A line that is silent (for a second, or five T if that is longer) is forgotten.
//
// Fails: two senders whose lines are closer than the tolerance look like one whose samples come twice; samples whose
// numbers do not count are all their own.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace faultline {

class SenderWatch {
 public:
  explicit SenderWatch(double period);  // T [s]

  // Whether the sample is of the sender that counts. `stamp`, `arrival`: s.
  bool own(std::uint64_t number, double stamp, double arrival);
  std::uint64_t foreign() const { return foreign_; }  // samples so far that were not own

 private:
  struct Line {
    std::uint64_t number = 0, samples = 0;  // its last number; 0 samples: no line
    double stamp = 0, arrival = 0;          // s, of its last sample
    bool foreign = false;
  };
  bool goes_on(const Line& line, std::uint64_t number, double stamp) const;
  std::size_t begin_line() const;  // the place of the one that was heard longest ago

  double period_, tolerance_, silence_;  // s
  std::array<Line, 4> lines_;
  std::size_t own_ = 0;
  std::uint64_t foreign_ = 0;
};

}  // namespace faultline

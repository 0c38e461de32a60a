// Prognosis of one observed variable: when it will reach an end of its range at the operating points that lie nearest
// to that end, if it goes on drifting as it does.
//
// Each bin of the operating range has an anchor: mean m and limits l < m < h that it had when it was healthy. Towards
// the high end H the nearest bins are those whose h lies in the highest quarter of all anchors' span; what is left is
// H - max h. Towards the low end likewise. Samples y of these bins give d = y - m; means of d over blocks are fitted by
// a line in time, a + b s, by least squares with weights that fall by e over `horizon` (s counts from the last block).
// The end is reached where the line has climbed by what is left. The interval is Fieller's: all s at which the line's
// 90 % band, from its covariance and the scatter of the blocks about it, holds that level. Where b is not above nothing
// by that measure, nothing is in sight (kNever), with the band's upper edge as the earliest time that cannot be
// excluded.
//
// Assumes a drift that goes on in a straight line over the horizon; one that bends scatters the blocks and widens the
// interval. A drift during the time in which anchors were learnt is not seen. Times in s, values in the variable's
// unit.
#pragma once

#include <cstddef>
#include <vector>

namespace faultline {

constexpr double kNever = 1e9;  // s; beyond it, and for what is not in sight

struct Crossing {
  double value = kNever, low = kNever, high = kNever;  // s from now; low and high: two-sided 90 %
};

// A line through block means, newest at s = 0.
class DriftLine {
 public:
  void add(double passed, double value, double horizon);  // passed: s since the block before
  // When it reaches `level` above nothing, from `since` after the last block on.
  Crossing reaches(double level, double since) const;
  void clear() { *this = DriftLine(); }

 private:
  double n_ = 0, s_ = 0, ss_ = 0, y_ = 0, sy_ = 0, yy_ = 0;  // weighted sums
};

class SaturationWatch {
 public:
  // low, high: the ends; block: samples.
  SaturationWatch(std::size_t bins, double low, double high, int block, double horizon);

  bool started() const { return started_; }  // some bin is anchored
  bool anchored(std::size_t bin) const { return anchors_[bin].low < anchors_[bin].high; }
  void anchor(std::size_t bin, double mean, double low, double high);
  void pass(double dt);
  void add(std::size_t bin, double value);  // of an anchored bin, at the time that has passed
  void restart();                           // the drift is forgotten, not the anchors
  Crossing crossing() const;                // of the end that is reached first

 private:
  struct Anchor {
    double mean = 0, low = 0, high = 0;
    bool near[2] = {false, false};  // the low end, the high end
  };
  struct Side {
    double left = 0;  // from the nearest anchor's limit to the end
    DriftLine line;
    double sum = 0, since = 0;
    int count = 0;
  };

  double ends_[2], horizon_;
  int block_;
  bool started_ = false;
  std::vector<Anchor> anchors_;
  Side sides_[2];
};

}  // namespace faultline

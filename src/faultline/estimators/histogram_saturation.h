// Prognosis of one observed variable: when it will reach an end of its range at the operating points that lie nearest
// to that end, if it goes on drifting as it does.
//
// Each bin of the operating range has an anchor: mean m and limits l < m < h that it had when it was healthy. Towards
// the high end H the near bins are those whose h lies in the upper half of all anchors' span; what is left is
// L = H - max h. Towards the low end likewise. Samples y of these bins give d = y - m and z, how far h lies from max h
// as a share of the span. Means of d and z over blocks are followed by
//
//   d = a + (b + c z) g + e k,   g = max(0, t - tau)^p,   p = 1/2, 3/4, 1, 3/2, 2, 3;   k = max(0, t - bend), p = 1
//
// by least squares: a drift that began at tau, differs between operating points, may grow slower or faster, or changes
// its rate once. The end is reached where a + b g + e k has climbed by L. The interval holds, of every tau, p and bend,
// all g for which L, known to the half width w of the healthy band (max h - its m, taken for a 90 % interval), lies in
// the 90 % band of the course (Fieller's), the band narrowed by what the blocks speak against that tau, p and bend: the
// profile likelihood of the crossing, the blocks' scatter widened by its correlation from one to the next, of which a
// fit hides some parameters/blocks. What is told lies between, each tau and p counted by its likelihood, a straight
// line before one that is curved (p = 1/2: 1/4; 3/4: 1/2; 1: 1; 3/2: 1/4; 2: 1/16; 3: 1/64); a bend widens only the
// interval. Where no drift beats a constant by what searching tau finds in noise, or the end lies farther off than
// five times the horizon, nothing is in sight (kNever), with the earliest time that cannot be excluded as `low`.
//
// Blocks grow as the drift lasts, so that memory is fixed; those older than `horizon` are forgotten. A drift during the
// time in which anchors were learnt is not seen. Times in s, values in the variable's unit.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace faultline {

constexpr double kNever = 1e9;  // s; beyond it, and for what is not in sight

struct Crossing {
  double value = kNever, low = kNever, high = kNever;  // s from now; low and high: two-sided 90 %

  Crossing after(double passed) const;
};

class DriftCourse {
 public:
  // Means over a block: when it was, the drift, and z; blocks of small and of large z each in their order.
  void add(double time, double drift, double z, double horizon);
  // Of what is left, known to that half width of a 90 % interval.
  Crossing reaches(double left, double doubt, double now) const;
  void clear() { *this = DriftCourse(); }

 private:
  struct Block {
    double time = 0, drift = 0, z = 0, weight = 0;
  };
  struct Track {
    std::array<Block, 32> blocks;  // oldest first
    std::size_t count = 0;
    double full = 1;  // the weight of a block that is not added to

    void halve();
  };
  struct Fit;

  Fit fit(double tau, double bend, double now, int exponent) const;
  template <class F>
  void for_each_block(F f) const;

  Track tracks_[2];
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
    double z[2] = {0, 0};
  };
  struct Sums {
    double drift = 0, z = 0, time = 0;
    int count = 0;
  };
  struct Side {
    double left = 0, doubt = 0;  // from the nearest anchor's limit to the end; from its mean to the limit
    DriftCourse course;
    Crossing crossing;  // as of the last block, at `told`
    double told = 0;
    Sums sums[2];  // of small and of large z
  };

  double ends_[2], horizon_, now_ = 0;
  int block_;
  bool started_ = false;
  std::vector<Anchor> anchors_;
  Side sides_[2];
};

}  // namespace faultline

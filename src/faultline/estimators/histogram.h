// Multi-variable histogram: how one observed variable is distributed at each operating point, learnt from samples.
//
// One or two explanatory variables (or none) cut the operating range into bins; every bin holds a histogram of the
// observed variable, made of `sections` of one width. From a bin's histogram follow its mean m and its limits l < m <
// h: the share `coverage` of the samples below m lies above l, and that of the samples above m lies below h. A sample
// y is scaled to z = 1/2 + (y - m)/(2 (h - m)) above m, with (m - l) below: 0 at the low limit, 1 at the high one. The
// moving average of z crosses all operating points and leaves 0..1 where the variable shifts. Source: Manninen, "Fault
// Simulator and Detection for a Process Control Valve", Aalto University 2012, section 4.1 (after Friman).
//
// Fixed memory. A step costs a few operations; every 8th of a bin's population its limits are computed anew, which is
// one pass over its sections. Forgetting: at `memory` samples in a bin all its counts are halved. A bin's histogram
// finds its own range: it begins one quantum wide a section and moves, or pairs its sections, where samples fall
// outside; single outliers (fewer than one in 32) count in the section at the end instead. Where nearly all of its
// population lies in three eighths of its sections, these are cut in two: what a first visit brought, while the rig was
// still moving, does not coarsen it for good.
//
// Values are in quanta of the variable's range, sections hold those that are whole when rounded; counts have 16 bits.
// Floating arithmetic: values are real numbers. Integer: whole quanta, shifts, one division a step, nothing wider than
// 64 bits; for a positioner's processor. Both run the same steps; their limits differ by less than one section.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <type_traits>
#include <vector>

namespace faultline {

struct HistogramShape {
  int bins[2] = {1, 1};  // per explanatory variable; 1: there is none
  int sections = 32;     // even, up to kMostSections
  int minimum = 64;      // samples before a bin may judge
  int memory = 32767;    // samples in a bin at which its counts are halved; 2 minimum up to kMostMemory
  double coverage = 0.9;
  int average_shift = 5;  // the moving average runs over 2^this samples, up to kMostShift ...
  int window_shift = 12;  // ... the shares of time beyond the limits over 2^this, and the level
};

constexpr int kMostSections = 128, kMostMemory = 65535, kMostShift = 15;
constexpr int kExplanatoryQuanta = 1 << 16;  // an explanatory variable runs over 0 .. this

struct FloatingArithmetic {
  using Value = double;  // a variable, in quanta
  using Wide = double;   // ranks, and positions in sections, in parts of kOne
  using Sum = double;    // a moving average
  static constexpr Wide kOne = 1;
  static constexpr Sum kScaled = 1;  // z of the high limit
  static std::int32_t section(Value q, int shift) {
    return static_cast<std::int32_t>(std::floor((q + 0.5) * part(shift)));
  }
  static Value value(Wide position, int shift) { return position * (1 << shift) - 0.5; }
  static Sum average(Sum sum, int shift) { return sum * part(shift); }
  // 2^-shift, made of its bits: a step has no time for a division.
  static double part(int shift) {
    const std::uint64_t bits = static_cast<std::uint64_t>(1023 - shift) << 52;
    double result;
    std::memcpy(&result, &bits, sizeof result);
    return result;
  }
};

struct IntegerArithmetic {
  using Value = std::int32_t;
  using Wide = std::int64_t;
  using Sum = std::int32_t;
  static constexpr Wide kOne = 1 << 12;
  static constexpr Sum kScaled = 1 << 12;
  static std::int32_t section(Value q, int shift) { return q >> shift; }
  static Value value(Wide position, int shift) { return static_cast<Value>((position << shift) >> 12); }
  static Sum average(Sum sum, int shift) { return sum >> shift; }
};

template <class A>
class Histogram {
 public:
  using Value = typename A::Value;
  using Count = std::uint16_t;

  struct Bin {
    std::int32_t first = 0;        // section: the histogram begins at first 2^shift quanta
    Value mean{}, low{}, high{};   // once ready()
    std::uint16_t population = 0;  // of its counts
    std::uint16_t fresh = 0;       // samples since the limits were computed
    std::uint8_t shift = 0;        // a section is 2^shift quanta wide
  };

  explicit Histogram(const HistogramShape& shape)
      : shape_(shape),
        coverage_(static_cast<typename A::Wide>(shape.coverage * static_cast<double>(A::kOne))),
        bins_(static_cast<std::size_t>(shape.bins[0]) * static_cast<std::size_t>(shape.bins[1])),
        counts_(bins_.size() * static_cast<std::size_t>(shape.sections)) {
    restart();
  }

  // The operating point, from the explanatory variables in quanta; beyond their range the bins at its ends.
  std::size_t bin_of(const Value* explanatory) const {
    std::int32_t place = 0;
    for (int i = 0; i < 2; ++i) {
      if (shape_.bins[i] == 1) continue;
      const Value q = std::clamp<Value>(explanatory[i], 0, kExplanatoryQuanta - 1);
      place = place * shape_.bins[i] +
              std::min(static_cast<std::int32_t>(q * static_cast<Value>(shape_.bins[i]) / kExplanatoryQuanta),
                       shape_.bins[i] - 1);
    }
    return static_cast<std::size_t>(place);
  }

  // Moves averages on by one sample; false where its bin may not judge yet, and nothing moves.
  bool judge(std::size_t bin, Value q) {
    if (!ready(bin)) return false;
    const typename A::Sum z = scaled(bins_[bin], q);
    average_ += z - A::average(average_, shape_.average_shift);
    const typename A::Sum mean = A::average(average_, shape_.average_shift);
    above_ += (mean > A::kScaled ? kWhole : 0) - A::average(above_, shape_.window_shift);
    below_ += (mean < 0 ? kWhole : 0) - A::average(below_, shape_.window_shift);
    level_ += std::clamp<typename A::Sum>(z, 0, A::kScaled) - A::average(level_, shape_.window_shift);
    return true;
  }

  void learn(std::size_t place, Value q) {
    Bin& bin = bins_[place];
    Count* n = counts_of(place);
    ++n[section_for(bin, n, q)];
    ++bin.population;
    ++bin.fresh;
    if (bin.population >= shape_.memory) halve(bin, n);
    if (bin.population >= shape_.minimum && (bin.fresh > bin.population / 8 || bin.low == bin.high)) {
      refine(bin, n);
      refresh(bin, n);
    }
  }

  // Averages begin anew, in the middle; what was learnt stays.
  void restart() {
    average_ = level_ = A::kScaled / 2;
    for (int i = 0; i < shape_.average_shift; ++i) average_ *= 2;
    for (int i = 0; i < shape_.window_shift; ++i) level_ *= 2;
    above_ = below_ = 0;
  }

  bool ready(std::size_t bin) const { return bins_[bin].low < bins_[bin].high; }
  double average() const { return plain(average_, A::kScaled, shape_.average_shift); }
  // Shares of the window in which the average was beyond its limits.
  double above() const { return plain(above_, kWhole, shape_.window_shift); }
  double below() const { return plain(below_, kWhole, shape_.window_shift); }
  // Mean over the window of samples scaled and cut at their limits: a small shift of the middle shows in it long before
  // the average leaves the limits, and what is far out for a moment does not count for more.
  double level() const { return plain(level_, A::kScaled, shape_.window_shift); }

  const HistogramShape& shape() const { return shape_; }
  const std::vector<Bin>& bins() const { return bins_; }
  const Count* counts(std::size_t bin) const {
    return counts_.data() + bin * static_cast<std::size_t>(shape_.sections);
  }
  // What was learnt in one bin before, of the same shape; its limits follow from it. False where that is no histogram.
  bool restore(std::size_t place, std::int32_t first, int shift, const double* counts) {
    Bin& bin = bins_[place];
    Count* n = counts_of(place);
    double sum = 0;
    for (int i = 0; i < shape_.sections; ++i) sum += counts[i];
    if (shift < 0 || shift > kMostShift + 1 || sum > kMostMemory || std::abs(first) > kExplanatoryQuanta) return false;
    for (int i = 0; i < shape_.sections; ++i) {
      if (!(counts[i] >= 0)) return false;
      n[i] = static_cast<Count>(counts[i]);
    }
    bin = Bin();
    bin.first = first;
    bin.shift = static_cast<std::uint8_t>(shift);
    bin.population = static_cast<Count>(sum);
    if (bin.population >= shape_.minimum) refresh(bin, n);
    return true;
  }
  std::size_t bytes() const { return sizeof *this + bins_.size() * sizeof(Bin) + counts_.size() * sizeof(Count); }

 private:
  using Wide = typename A::Wide;
  static constexpr typename A::Sum kWhole = std::is_integral_v<Value> ? typename A::Sum(1 << 15) : typename A::Sum(1);
  static constexpr int kSettled = 64;   // samples from which single outliers are known as such
  static constexpr int kOutliers = 32;  // at most one in so many

  Count* counts_of(std::size_t bin) { return counts_.data() + bin * static_cast<std::size_t>(shape_.sections); }

  static double plain(typename A::Sum sum, typename A::Sum one, int shift) {
    return std::ldexp(static_cast<double>(sum) / static_cast<double>(one), -shift);
  }

  typename A::Sum scaled(const Bin& bin, Value q) const {
    constexpr Value kFar = 7;  // half widths, beyond which it does not matter how far
    const Value distance = q - bin.mean;
    const Value half = distance < 0 ? bin.mean - bin.low : bin.high - bin.mean;
    const Value d = std::clamp<Value>(distance, -kFar * half, kFar * half);
    return A::kScaled / 2 + static_cast<typename A::Sum>(d * (A::kScaled / 2) / half);
  }

  int section_for(Bin& bin, Count* n, Value q) {
    if (bin.population == 0) {
      bin.shift = 0;
      bin.first = A::section(q, 0) - shape_.sections / 2;
    }
    for (;;) {
      const std::int32_t i = A::section(q, bin.shift) - bin.first;
      if (i >= 0 && i < shape_.sections) return i;
      const int end = i < 0 ? 0 : shape_.sections - 1;
      if (bin.population >= kSettled && n[end] + 1 <= static_cast<Count>(bin.population / kOutliers)) return end;
      make_room(bin, n, i < 0);
    }
  }

  // Below or above: by a quarter of the sections if the quarter at the other end is as good as empty, else by sections
  // twice as wide.
  void make_room(Bin& bin, Count* n, bool below) {
    const int all = shape_.sections, quarter = all / 4;
    Wide far = 0;
    for (int i = 0; i < quarter; ++i) far += static_cast<Wide>(n[below ? all - 1 - i : i]);
    Count moved[kMostSections] = {};
    std::int32_t first;
    if (far * kOutliers <= static_cast<Wide>(bin.population)) {
      first = bin.first + (below ? -quarter : quarter);
      for (int i = 0; i < all; ++i) put(moved, std::clamp(bin.first + i - first, 0, all - 1), n[i]);
    } else {
      first = (bin.first >> 1) - (below ? all / 2 - 1 : 0);
      for (int i = 0; i < all; ++i) put(moved, std::min(((bin.first + i) >> 1) - first, all - 1), n[i]);
      ++bin.shift;
    }
    bin.first = first;
    std::copy_n(moved, all, n);
  }
  static void put(Count* n, int i, Count more) { n[i] = static_cast<Count>(n[i] + more); }

  // Half of the sections are left, each cut in two; at most one in 64 samples lies to either side of the three eighths.
  void refine(Bin& bin, Count* n) {
    const int all = shape_.sections;
    const auto few = static_cast<Count>(bin.population / (2 * kOutliers));
    if (bin.shift == 0 || all < 8) return;
    int begin = 0, end = all;
    for (Count below = n[0]; below <= few; below = static_cast<Count>(below + n[begin])) ++begin;
    for (Count above = n[end - 1]; above <= few; above = static_cast<Count>(above + n[end - 1])) --end;
    if (end - begin > all * 3 / 8) return;
    const int from = std::clamp((begin + end - all / 2) / 2, 0, all / 2);
    Count moved[kMostSections] = {};
    for (int i = 0; i < all; ++i) {
      const auto half = static_cast<Count>(n[i] / 2);
      put(moved, std::clamp(2 * (i - from), 0, all - 1), half);
      put(moved, std::clamp(2 * (i - from) + 1, 0, all - 1), static_cast<Count>(n[i] - half));
    }
    bin.first = (bin.first + from) * 2;
    --bin.shift;
    std::copy_n(moved, all, n);
  }

  // What is left over goes to the next section, so that the sums up to any section stay right.
  void halve(Bin& bin, Count* n) {
    std::uint32_t left = 0, sum = 0;
    for (int i = 0; i < shape_.sections; ++i) {
      left += n[i];
      n[i] = static_cast<Count>(left >> 1);
      left &= 1;
      sum += n[i];
    }
    bin.population = static_cast<Count>(sum);
  }

  void refresh(Bin& bin, const Count* n) {
    bin.fresh = 0;
    Wide sum = 0, moment = 0;
    for (int i = 0; i < shape_.sections; ++i) {
      sum += static_cast<Wide>(n[i]);
      moment += static_cast<Wide>(n[i]) * (2 * i + 1);
    }
    const Wide mean = moment * A::kOne / (2 * sum);
    const auto at = static_cast<int>(mean / A::kOne);
    Wide below = 0;  // rank of the mean
    for (int i = 0; i < at; ++i) below += static_cast<Wide>(n[i]) * A::kOne;
    below += static_cast<Wide>(n[at]) * (mean - static_cast<Wide>(at) * A::kOne);
    // Of all samples, those below and those above the mean; a limit is at least half a section away from it.
    const Wide low = position(n, below - below * coverage_ / A::kOne);
    const Wide high = position(n, below + (sum * A::kOne - below) * coverage_ / A::kOne);
    const auto value = [&](Wide p) { return A::value(static_cast<Wide>(bin.first) * A::kOne + p, bin.shift); };
    bin.mean = value(mean);
    bin.low = std::min<Value>(value(std::min<Wide>(low, mean - A::kOne / 2)), bin.mean - kLeast);
    bin.high = std::max<Value>(value(std::max<Wide>(high, mean + A::kOne / 2)), bin.mean + kLeast);
  }
  static constexpr Value kLeast = std::is_integral_v<Value> ? Value(1) : Value(0.5);

  Wide position(const Count* n, Wide rank) const {
    Wide sum = 0;
    for (int i = 0; i < shape_.sections; ++i) {
      const Wide next = sum + static_cast<Wide>(n[i]) * A::kOne;
      if (next > rank) return static_cast<Wide>(i) * A::kOne + (rank - sum) / static_cast<Wide>(n[i]);
      sum = next;
    }
    return static_cast<Wide>(shape_.sections) * A::kOne;
  }

  HistogramShape shape_;
  Wide coverage_;
  std::vector<Bin> bins_;
  std::vector<Count> counts_;
  typename A::Sum average_{}, above_{}, below_{}, level_{};  // times 2^shift
};

}  // namespace faultline

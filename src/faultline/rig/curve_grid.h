// Nodes of a tabulated curve (effects/free_curve.cpp) over a range, and straight lines between them.
//
//   t = sgn(x) sqrt|x| evenly spaced where the range holds 0, so that what turns near 0 (friction, a dead zone) is
//   resolved: +-1/16, +-1/4, +-9/16 of a range that is even; x evenly spaced where it does not
//
// Beyond the range: the value at its end. A range of no width is its lower end.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace faultline {

constexpr std::size_t kCurveNodes = 9;
using CurveValues = std::array<double, kCurveNodes>;

class CurveGrid {
 public:
  CurveGrid(double low = -1, double high = 1) : rooted_(low < 0 && high > 0) {
    for (std::size_t j = 0; j < kCurveNodes; ++j) {
      const double share = static_cast<double>(j) / (kCurveNodes - 1);
      const double t = even(low) + share * (even(high) - even(low));
      nodes_[j] = rooted_ ? t * std::abs(t) : t;
    }
    first_ = even(low);
    step_ = (even(high) - first_) / (kCurveNodes - 1);
  }
  const CurveValues& nodes() const { return nodes_; }

  // Between which node and the next x lies, and how far from the one to the other (0 to 1).
  struct Place {
    std::size_t node = 0;
    double share = 0;
  };
  Place place(double x) const {
    if (!(step_ > 0) || !(x > nodes_.front())) return {};
    if (x >= nodes_.back()) return {kCurveNodes - 2, 1};
    const double at = std::clamp((even(x) - first_) / step_, 0.0, kCurveNodes - 2.0);
    const auto node = static_cast<std::size_t>(at);
    return {node, std::clamp((x - nodes_[node]) / (nodes_[node + 1] - nodes_[node]), 0.0, 1.0)};
  }
  double value(const CurveValues& values, double x) const {
    const Place at = place(x);
    return (1 - at.share) * values[at.node] + at.share * values[at.node + 1];
  }
  // x of x + value(x) = y; NaN where that is no function of y.
  double undo(const CurveValues& values, double y) const {
    for (std::size_t j = 0; j + 1 < kCurveNodes; ++j)
      if (nodes_[j + 1] + values[j + 1] <= nodes_[j] + values[j] && step_ > 0) return std::nan("");
    if (!(step_ > 0) || y <= nodes_.front() + values.front()) return y - values.front();
    if (y >= nodes_.back() + values.back()) return y - values.back();
    std::size_t j = 0;
    while (j + 2 < kCurveNodes && y >= nodes_[j + 1] + values[j + 1]) ++j;
    const double low = nodes_[j] + values[j], high = nodes_[j + 1] + values[j + 1];
    return nodes_[j] + (y - low) / (high - low) * (nodes_[j + 1] - nodes_[j]);
  }

 private:
  double even(double x) const { return rooted_ ? std::copysign(std::sqrt(std::abs(x)), x) : x; }

  bool rooted_;
  double first_ = 0, step_ = 0;
  CurveValues nodes_{};
};

}  // namespace faultline

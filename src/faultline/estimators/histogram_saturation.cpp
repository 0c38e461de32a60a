#include "faultline/estimators/histogram_saturation.h"

#include <algorithm>
#include <cmath>

namespace faultline {
namespace {

constexpr double kNear = 0.25;       // of the anchors' span
constexpr double kFewest = 6;        // blocks' weight below which there is no line
constexpr double kQuantile = 1.645;  // two-sided 90 %

double within(double s) { return std::clamp(s, 0.0, kNever); }

}  // namespace

void DriftLine::add(double passed, double value, double horizon) {
  // All s grow older by `passed`.
  ss_ += passed * (passed * n_ - 2 * s_);
  sy_ -= passed * y_;
  s_ -= passed * n_;
  const double fade = std::exp(-passed / horizon);
  for (double* sum : {&n_, &s_, &ss_, &y_, &sy_, &yy_}) *sum *= fade;
  n_ += 1;
  y_ += value;
  yy_ += value * value;
}

Crossing DriftLine::reaches(double level, double since) const {
  Crossing result;
  const double det = n_ * ss_ - s_ * s_;
  if (n_ < kFewest || !(det > 0)) return result;
  const double b = (n_ * sy_ - s_ * y_) / det, a = (ss_ * y_ - s_ * sy_) / det;
  const double variance = std::max(0.0, yy_ - a * y_ - b * sy_) / (n_ - 2);
  const double q = kQuantile * kQuantile * variance / det;  // times the covariance of (a, b): ss, -s, n over det
  const double left = level - a;
  if (left <= b * since) {
    result.value = result.low = 0;
  } else if (b > 0) {
    result.value = within(left / b - since);
  }
  // (b s - left)^2 = q (ss - 2 s_ s + n s^2)
  const double A = b * b - q * n_, B = -2 * (b * left - q * s_), C = left * left - q * ss_;
  const double root = std::sqrt(std::max(0.0, B * B - 4 * A * C));
  if (A > 0 && b > 0) {
    result.low = within((-B - root) / (2 * A) - since);
    result.high = within((-B + root) / (2 * A) - since);
    return result;
  }
  if (result.value > 0) {
    result.value = kNever;
    if (C <= 0)
      result.low = 0;
    else if (A < 0)
      result.low = within((-B - root) / (2 * A) - since);  // A < 0 < C: the positive one
  }
  return result;
}

SaturationWatch::SaturationWatch(std::size_t bins, double low, double high, int block, double horizon)
    : ends_{low, high}, horizon_(horizon), block_(block), anchors_(bins) {}

void SaturationWatch::anchor(std::size_t bin, double mean, double low, double high) {
  anchors_[bin] = {mean, low, high, {false, false}};
  started_ = true;
  double least = high, most = low;
  for (const Anchor& a : anchors_) {
    if (!(a.low < a.high)) continue;
    least = std::min(least, a.low);
    most = std::max(most, a.high);
  }
  for (Anchor& a : anchors_) {
    a.near[0] = a.low < a.high && a.low <= least + kNear * (most - least);
    a.near[1] = a.low < a.high && a.high >= most - kNear * (most - least);
  }
  sides_[0].left = least - ends_[0];
  sides_[1].left = ends_[1] - most;
}

void SaturationWatch::pass(double dt) {
  for (Side& side : sides_) side.since += dt;
}

void SaturationWatch::add(std::size_t bin, double value) {
  const Anchor& a = anchors_[bin];
  for (int k = 0; k < 2; ++k) {
    if (!a.near[k]) continue;
    Side& side = sides_[k];
    side.sum += k == 0 ? a.mean - value : value - a.mean;
    if (++side.count < block_) continue;
    side.line.add(side.since, side.sum / side.count, horizon_);
    side.since = side.sum = 0;
    side.count = 0;
  }
}

void SaturationWatch::restart() {
  for (Side& side : sides_) {
    side.line.clear();
    side.sum = side.since = 0;
    side.count = 0;
  }
}

Crossing SaturationWatch::crossing() const {
  const Crossing low = sides_[0].line.reaches(sides_[0].left, sides_[0].since);
  Crossing high = sides_[1].line.reaches(sides_[1].left, sides_[1].since);
  if (low.value < high.value || (low.value == high.value && low.low < high.low)) return low;
  return high;
}

}  // namespace faultline

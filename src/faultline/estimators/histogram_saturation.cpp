#include "faultline/estimators/histogram_saturation.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Core>
#include <Eigen/LU>

namespace faultline {
namespace {

constexpr double kNear = 0.5;             // of the anchors' span
constexpr std::size_t kFewest = 8;        // blocks below which there is no course
constexpr double kParameters = 4;         // a, b, c, tau
constexpr double kQuantile = 1.645;       // two-sided 90 %
constexpr double kSeen = 12;              // variances that a drift must win: beyond 3 sigma, for tau is sought
constexpr double kMostCorrelation = 0.8;  // of one block with the next
constexpr double kRidge = 1e-9;           // where all blocks lie at one operating point
enum Exponent { kHalf, kThreeQuarters, kStraight, kThreeHalves, kSquare, kCube, kExponents };
constexpr double kPrior[kExponents] = {1.0 / 4, 1.0 / 2, 1, 1.0 / 4, 1.0 / 16, 1.0 / 64};

double within(double s) { return std::clamp(s, 0.0, kNever); }

double grown(double s, int exponent) {
  if (s <= 0) return 0;
  switch (exponent) {
    case kHalf:
      return std::sqrt(s);
    case kThreeQuarters:
      return std::sqrt(s * std::sqrt(s));
    case kStraight:
      return s;
    case kThreeHalves:
      return s * std::sqrt(s);
    case kSquare:
      return s * s;
    default:
      return s * s * s;
  }
}

double time_of(double g, int exponent) {
  if (!(g < kNever)) return kNever;
  switch (exponent) {
    case kHalf:
      return g * g;
    case kThreeQuarters:
      return g * std::cbrt(g);
    case kStraight:
      return g;
    case kThreeHalves:
      return std::cbrt(g * g);
    case kSquare:
      return std::sqrt(g);
    default:
      return std::cbrt(g);
  }
}

}  // namespace

Crossing Crossing::after(double passed) const {
  const auto less = [passed](double s) { return s >= kNever ? kNever : within(s - passed); };
  return {less(value), less(low), less(high)};
}

struct DriftCourse::Fit {
  Eigen::Vector3d theta;       // a, b, c; g in units of `scale`
  Eigen::Matrix3d covariance;  // over the variance of a block
  double loss = 0, scale = 1;
};

template <class F>
void DriftCourse::for_each_block(F f) const {
  for (const Track& track : tracks_)
    for (std::size_t i = 0; i < track.count; ++i) f(track.blocks[i]);
}

void DriftCourse::Track::halve() {
  for (std::size_t i = 0; i < blocks.size() / 2; ++i) {
    const Block &x = blocks[2 * i], &y = blocks[2 * i + 1];
    const double weight = x.weight + y.weight;
    const auto mean = [&](double p, double q) { return (x.weight * p + y.weight * q) / weight; };
    blocks[i] = {mean(x.time, y.time), mean(x.drift, y.drift), mean(x.z, y.z), weight};
  }
  count = blocks.size() / 2;
  full *= 2;
}

void DriftCourse::add(double time, double drift, double z, double horizon) {
  Track& track = tracks_[z > 0.5 * kNear];
  if (track.count > 0 && track.blocks[track.count - 1].weight < track.full) {
    Block& last = track.blocks[track.count - 1];
    const double weight = last.weight + 1;
    last = {last.time + (time - last.time) / weight, last.drift + (drift - last.drift) / weight,
            last.z + (z - last.z) / weight, weight};
  } else {
    if (track.count == track.blocks.size()) track.halve();
    track.blocks[track.count++] = {time, drift, z, 1};
  }
  for (Track& t : tracks_) {
    const auto begin = t.blocks.begin(), end = begin + static_cast<std::ptrdiff_t>(t.count);
    const auto kept = std::find_if(begin, end, [&](const Block& block) { return block.time >= time - horizon; });
    t.count = static_cast<std::size_t>(std::copy(kept, end, begin) - begin);
  }
}

DriftCourse::Fit DriftCourse::fit(double tau, double now, int exponent) const {
  Fit fit;
  fit.scale = std::max(now - tau, 1e-9);
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  double square = 0;
  for_each_block([&](const Block& block) {
    const double g = grown((block.time - tau) / fit.scale, exponent);
    const Eigen::Vector3d row(1, g, g * block.z);
    normal += block.weight * row * row.transpose();
    right += block.weight * block.drift * row;
    square += block.weight * block.drift * block.drift;
  });
  normal(2, 2) += kRidge * normal(1, 1) + 1e-300;
  fit.covariance = normal.inverse();
  fit.theta = fit.covariance * right;
  fit.loss = std::max(0.0, square - fit.theta.dot(right));
  return fit;
}

Crossing DriftCourse::reaches(double level, double now) const {
  Crossing result;
  const std::size_t count = tracks_[0].count + tracks_[1].count;
  if (count < kFewest) return result;
  double weights = 0, sum = 0, constant = 0, newest = 0;
  for_each_block([&](const Block& block) {
    weights += block.weight;
    sum += block.weight * block.drift;
    newest = std::max(newest, block.time);
  });
  for_each_block([&](const Block& block) { constant += block.weight * std::pow(block.drift - sum / weights, 2); });
  // Of all times at which a block was, and all exponents.
  const auto for_each_fit = [&](auto f) {
    for (int e = 0; e < kExponents; ++e)
      for_each_block([&](const Block& block) {
        if (block.time < newest) f(block.time, e, fit(block.time, now, e));
      });
  };
  double best = constant, best_tau = 0;
  int best_exponent = -1;
  for_each_fit([&](double tau, int e, const Fit& f) {
    if (!(f.loss < best) || f.theta[1] <= 0) return;
    best = f.loss;
    best_tau = tau;
    best_exponent = e;
  });
  const double variance = std::max(best / (static_cast<double>(count) - kParameters), 1e-30);
  double correlation = 0;
  if (best_exponent >= 0) {
    const Fit f = fit(best_tau, now, best_exponent);
    double before = 0;
    for (std::size_t i = 0, j = 0; i + j < count;) {  // in their order in time
      const bool first =
          j == tracks_[1].count || (i < tracks_[0].count && tracks_[0].blocks[i].time < tracks_[1].blocks[j].time);
      const Block& block = first ? tracks_[0].blocks[i++] : tracks_[1].blocks[j++];
      const double g = grown((block.time - best_tau) / f.scale, best_exponent);
      const double off = std::sqrt(block.weight) * (block.drift - f.theta.dot(Eigen::Vector3d(1, g, g * block.z)));
      correlation += off * before;
      before = off;
    }
    // What is left of a fit seems less correlated than it is, by some parameters/blocks.
    correlation /= std::max(best, 1e-300);
    correlation += kParameters / static_cast<double>(count) * (1 + correlation);
    correlation = std::clamp(correlation, 0.0, kMostCorrelation);
  }
  const double widened = variance * (1 + correlation) / (1 - correlation);
  const bool seen = best_exponent >= 0 && constant - best > kSeen * widened;
  const double allowed = kQuantile * kQuantile * widened;
  double low = kNever, high = 0, likelihoods = 0, rates = 0;
  for_each_fit([&](double tau, int e, const Fit& f) {
    const double worse = std::max(0.0, f.loss - best), k = allowed - worse;
    if (k < 0) return;
    const double a = f.theta[0], b = f.theta[1], left = level - a;
    const auto from_now = [&](double g) { return within(f.scale * time_of(g, e) - (now - tau)); };
    // (left - b g)^2 <= k (Caa + 2 g Cab + g^2 Cbb)
    const double A = b * b - k * f.covariance(1, 1), B = -2 * (b * left + k * f.covariance(0, 1)),
                 C = left * left - k * f.covariance(0, 0);
    const double root = std::sqrt(std::max(0.0, B * B - 4 * A * C));
    if (A > 0 && b > 0) {
      low = std::min(low, from_now((-B - root) / (2 * A)));
      high = std::max(high, from_now((-B + root) / (2 * A)));
    } else if (A <= 0) {
      low = std::min(low, C <= 0 ? 0.0 : A < 0 ? from_now((-B - root) / (2 * A)) : kNever);
      high = kNever;
    }
    if (b <= 0) return;
    const double likelihood = kPrior[e] * std::exp(-0.5 * worse / widened);
    likelihoods += likelihood;
    rates += likelihood / std::max(from_now(std::max(0.0, left) / b), 1e-3);
  });
  result.low = low;
  if (!seen || !(rates > 0)) return result;
  result.value = within(likelihoods / rates);
  if (result.value < 1) result.value = 0;
  result.low = std::min(low, result.value);
  result.high = std::max(high, result.value);
  return result;
}

SaturationWatch::SaturationWatch(std::size_t bins, double low, double high, int block, double horizon)
    : ends_{low, high}, horizon_(horizon), block_(block), anchors_(bins) {}

void SaturationWatch::anchor(std::size_t bin, double mean, double low, double high) {
  anchors_[bin].mean = mean;
  anchors_[bin].low = low;
  anchors_[bin].high = high;
  started_ = true;
  double least = high, most = low;
  for (const Anchor& a : anchors_) {
    if (!(a.low < a.high)) continue;
    least = std::min(least, a.low);
    most = std::max(most, a.high);
  }
  for (Anchor& a : anchors_) {
    a.z[0] = (a.low - least) / (most - least);
    a.z[1] = (most - a.high) / (most - least);
    for (int k = 0; k < 2; ++k) a.near[k] = a.low < a.high && a.z[k] <= kNear;
  }
  sides_[0].left = least - ends_[0];
  sides_[1].left = ends_[1] - most;
}

void SaturationWatch::pass(double dt) { now_ += dt; }

void SaturationWatch::add(std::size_t bin, double value) {
  const Anchor& a = anchors_[bin];
  for (int k = 0; k < 2; ++k) {
    if (!a.near[k]) continue;
    Side& side = sides_[k];
    Sums& sums = side.sums[a.z[k] > 0.5 * kNear];
    sums.drift += k == 0 ? a.mean - value : value - a.mean;
    sums.z += a.z[k];
    sums.time += now_;
    if (++sums.count < block_) continue;
    const double n = sums.count;
    side.course.add(sums.time / n, sums.drift / n, sums.z / n, horizon_);
    side.crossing = side.course.reaches(side.left, now_);
    side.told = now_;
    sums = Sums();
  }
}

void SaturationWatch::restart() {
  for (Side& side : sides_) {
    side.course.clear();
    side.crossing = Crossing();
    for (Sums& sums : side.sums) sums = Sums();
  }
}

Crossing SaturationWatch::crossing() const {
  const Crossing low = sides_[0].crossing.after(now_ - sides_[0].told),
                 high = sides_[1].crossing.after(now_ - sides_[1].told);
  if (low.value < high.value || (low.value == high.value && low.low < high.low)) return low;
  return high;
}

}  // namespace faultline

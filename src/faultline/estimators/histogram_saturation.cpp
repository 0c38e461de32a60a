#include "faultline/estimators/histogram_saturation.h"

#include <algorithm>
#include <cmath>
#include <optional>

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
constexpr double kRidge = 1e-9;           // where all blocks lie at one operating point, or nothing bends
constexpr int kFewestBent = 4;            // blocks behind a bend
constexpr double kBend = 2;               // variances that a bend must win: two parameters
constexpr double kFarthest = 5;           // horizons
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
  double tau = 0, bend = 0;
  int exponent = kStraight;
  Eigen::Vector4d theta;       // a, b, c, e; g and k in units of `scale`
  Eigen::Matrix4d covariance;  // over the variance of a block
  double loss = 0, scale = 1;

  Eigen::Vector4d row(double time, double z) const {
    const double g = grown((time - tau) / scale, exponent);
    return {1, g, g * z, std::max(0.0, (time - bend) / scale)};
  }
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

DriftCourse::Fit DriftCourse::fit(double tau, double bend, double now, int exponent) const {
  Fit fit;
  fit.tau = tau;
  fit.bend = bend;
  fit.exponent = exponent;
  fit.scale = std::max(now - tau, 1e-9);
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  double square = 0;
  for_each_block([&](const Block& block) {
    const Eigen::Vector4d row = fit.row(block.time, block.z);
    normal += block.weight * row * row.transpose();
    right += block.weight * block.drift * row;
    square += block.weight * block.drift * block.drift;
  });
  for (int i = 2; i < 4; ++i) normal(i, i) += kRidge * normal(1, 1) + 1e-300;
  fit.covariance = normal.inverse();
  fit.theta = fit.covariance * right;
  fit.loss = std::max(0.0, square - fit.theta.dot(right));
  return fit;
}

Crossing DriftCourse::reaches(double left, double doubt, double now) const {
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
        if (block.time < newest) f(fit(block.time, kNever, now, e));
      });
  };
  const auto for_each_bent_fit = [&](auto f) {
    for_each_block([&](const Block& bend) {
      int behind = 0;
      for_each_block([&](const Block& block) { behind += block.time > bend.time; });
      if (behind < kFewestBent) return;
      for_each_block([&](const Block& block) {
        if (block.time < bend.time) f(fit(block.time, bend.time, now, kStraight));
      });
    });
  };
  std::optional<Fit> best;
  for_each_fit([&](const Fit& f) {
    if (f.loss < (best ? best->loss : constant) && f.theta[1] > 0) best = f;
  });
  const double least = best ? best->loss : constant;
  const double variance = std::max(least / (static_cast<double>(count) - kParameters), 1e-30);
  double correlation = 0;
  if (best) {
    double before = 0;
    for (std::size_t i = 0, j = 0; i + j < count;) {  // in their order in time
      const bool first =
          j == tracks_[1].count || (i < tracks_[0].count && tracks_[0].blocks[i].time < tracks_[1].blocks[j].time);
      const Block& block = first ? tracks_[0].blocks[i++] : tracks_[1].blocks[j++];
      const double off = std::sqrt(block.weight) * (block.drift - best->theta.dot(best->row(block.time, block.z)));
      correlation += off * before;
      before = off;
    }
    // What is left of a fit seems less correlated than it is, by some parameters/blocks.
    correlation /= std::max(least, 1e-300);
    correlation += kParameters / static_cast<double>(count) * (1 + correlation);
    correlation = std::clamp(correlation, 0.0, kMostCorrelation);
  }
  const double widened = variance * (1 + correlation) / (1 - correlation);
  const bool seen = best && constant - least > kSeen * widened;
  const double allowed = kQuantile * kQuantile * widened;
  double low = kNever, high = 0, likelihoods = 0, rates = 0;
  // (p - q g)^2 <= k var(p - q g), p what is left at g = 0 (the line behind the bend, drawn on), q the climb
  const auto count_in = [&](const Fit& f) {
    const bool bent = f.bend < kNever;
    const double worse = std::max(0.0, f.loss + (bent ? kBend * widened : 0) - least), k = allowed - worse;
    if (k < 0) return;
    const Eigen::Vector4d at_zero(1, 0, 0, bent ? (f.tau - f.bend) / f.scale : 0), climb(0, 1, 0, bent ? 1 : 0);
    const double p = left - f.theta.dot(at_zero), q = f.theta.dot(climb);
    const auto from_now = [&](double g) { return within(f.scale * time_of(g, f.exponent) - (now - f.tau)); };
    const double A = q * q - k * climb.dot(f.covariance * climb),
                 B = -2 * (p * q + k * at_zero.dot(f.covariance * climb)),
                 C = p * p - k * (at_zero.dot(f.covariance * at_zero) + doubt * doubt / allowed);
    const double root = std::sqrt(std::max(0.0, B * B - 4 * A * C));
    if (A > 0 && q > 0) {
      low = std::min(low, from_now((-B - root) / (2 * A)));
      high = std::max(high, from_now((-B + root) / (2 * A)));
    } else if (A <= 0) {
      low = std::min(low, C <= 0 ? 0.0 : A < 0 ? from_now((-B - root) / (2 * A)) : kNever);
      high = kNever;
    }
    if (q <= 0 || bent) return;
    const double likelihood = kPrior[f.exponent] * std::exp(-0.5 * worse / widened);
    likelihoods += likelihood;
    rates += likelihood / std::max(from_now(std::max(0.0, p) / q), 1e-3);
  };
  for_each_fit(count_in);
  for_each_bent_fit(count_in);
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
  sides_[0].left = least - ends_[0];
  sides_[1].left = ends_[1] - most;
  for (Anchor& a : anchors_) {
    if (a.low < a.high && a.low == least) sides_[0].doubt = a.mean - a.low;
    if (a.low < a.high && a.high == most) sides_[1].doubt = a.high - a.mean;
    a.z[0] = (a.low - least) / (most - least);
    a.z[1] = (most - a.high) / (most - least);
    for (int k = 0; k < 2; ++k) a.near[k] = a.low < a.high && a.z[k] <= kNear;
  }
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
    side.crossing = side.course.reaches(side.left, side.doubt, now_);
    if (side.crossing.value > kFarthest * horizon_) side.crossing.value = side.crossing.high = kNever;
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

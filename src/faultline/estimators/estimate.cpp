#include "faultline/estimators/estimate.h"

#include <algorithm>
#include <cmath>

#include "faultline/numerics/quantiles.h"

namespace faultline {
namespace {

constexpr double kLeastFraction = 1e-3;  // of the amplitude, where the interval of such a size would reach zero

}  // namespace

SizeInterval RankedHypothesis::sizes(double amplitude_std) const {
  const double least = std::isinf(none) ? kLeastFraction * amplitude : lowest;
  const double one = effect_size(none, full, std::max(amplitude - kNinetyPercentSigmas * amplitude_std, least));
  const double other = effect_size(none, full, amplitude + kNinetyPercentSigmas * amplitude_std);
  return {std::min(one, other), std::max(one, other)};
}

}  // namespace faultline

#include "faultline/gap/shrink.h"

#include <algorithm>
#include <cmath>

#include "faultline/numerics/quantiles.h"
#include "faultline/numerics/random.h"

namespace faultline {
namespace {

constexpr double kStillNoises = 3;  // of a channel, within which its movement is not told from its noise

}  // namespace

double shrink_of(Excess excess, const std::vector<double>& before, const std::vector<double>& after, double values) {
  const double first = excess(before, values);
  return first > 0 ? 1 - excess(after, values) / first : 0;
}

Interval shrink_interval(Excess excess, const std::vector<double>& before, const std::vector<double>& after,
                         double values, std::uint64_t seed, std::size_t bootstraps) {
  Random random(seed);
  std::vector<double> shrinks;
  for (std::size_t b = 0; b < bootstraps; ++b) {
    std::vector<double> first, second;
    for (std::size_t i = 0; i < before.size(); ++i) {
      const auto k = static_cast<std::size_t>(random.uniform() * static_cast<double>(before.size()));
      first.push_back(before[k]);
      second.push_back(after[k]);
    }
    if (excess(first, values) > 0) shrinks.push_back(shrink_of(excess, first, second, values));
  }
  if (shrinks.empty()) return {};
  std::sort(shrinks.begin(), shrinks.end());
  // Few segments drawn from themselves scatter too little.
  const double few = static_cast<double>(before.size()), middle = shrinks[shrinks.size() / 2];
  const double wider =
      few > 1 ? student_ninety_percent(few - 1) / kNinetyPercentSigmas * std::sqrt(few / (few - 1)) : 1;
  const double low = shrinks[shrinks.size() / 20], high = shrinks[shrinks.size() - 1 - shrinks.size() / 20];
  return {middle + wider * (low - middle), std::min(1.0, middle + wider * (high - middle))};
}

double gap_size(const GapLevel& level) {
  const auto moved = [](const ChannelGap& c) {
    const double part = c.nrmse.at("segment");
    return part > 0 ? c.rms.at("segment") / part : 0;
  };
  double squares = 0;
  for (const ChannelGap& c : level.channels) {
    double moves = moved(c);
    if (moves < kStillNoises * c.noise_std)
      for (const ChannelGap& like : level.channels)
        if (like.unit == c.unit) moves = std::max(moves, moved(like));
    const double beyond = std::pow(c.rms.at("segment"), 2) - std::pow(c.noise_std, 2);
    if (beyond > 0) squares += beyond / std::max(moves * moves, 1e-300);
  }
  return level.channels.empty() ? 0 : std::sqrt(squares / static_cast<double>(level.channels.size()));
}

double output_shrink(const GapLevel& before, const GapLevel& after, const std::vector<Candidate>& effects,
                     const GapOptions::Verdict& options) {
  double most = 0, closed = 0, opened = 0;
  for (std::size_t c = 0; c < before.channels.size(); ++c) {
    const double excess = before.channels[c].excess, gain = excess - after.channels[c].excess;
    (gain > 0 ? closed : opened) += std::abs(gain);
    if (excess > options.material_excess_variances) most = std::max(most, gain / excess);
  }
  const bool sensor = std::any_of(effects.begin(), effects.end(),
                                  [](const Candidate& c) { return port_kind(c.effect.port) == PortKind::sensor; });
  const bool shifted = opened > options.shifted_fraction * closed;
  return shifted || (sensor && most < options.closed_shrink_fraction) ? 0 : most;
}

}  // namespace faultline

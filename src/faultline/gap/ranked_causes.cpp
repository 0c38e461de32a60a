#include "faultline/gap/ranked_causes.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

namespace faultline {
namespace {

constexpr double kNearLeast = 0.1;   // of the coordinate of a size
constexpr double kNearNone = 0.005;  // of its range

// Over a logarithmic range the least size that is tried is not nothing.
bool near_least(const Candidate& candidate, const EffectParameter& parameter, std::size_t p) {
  const Bounds& b = candidate.bounds[p];
  const double value = candidate.effect.parameters[p];
  if (b.minimum >= b.maximum) return true;
  if (!candidate.logarithmic(p)) return std::abs(value - parameter.none) < kNearNone * (b.maximum - b.minimum);
  const double place = candidate.to_coordinate(p, value);
  return std::isinf(parameter.none) ? place > 1 - kNearLeast : place < kNearLeast;
}

// `apart`: how far fits of single runs lie from each other, in the effect's coordinates.
// `ninety`: half width of 90 % bounds in standard errors.
NamedEffect named(const FitResult& fit, std::size_t position, const Eigen::VectorXd& apart, double ninety,
                  const GapOptions::Verdict& options) {
  // The covariance knows nothing of what the model lacks.
  const double width = ninety * options.interval_ratio;
  const Candidate& candidate = fit.effects[position];
  NamedEffect result;
  result.effect = candidate.effect.effect;
  result.port = candidate.effect.port;
  result.family = candidate.family;
  const EffectType* type = find_effect_type(candidate.effect.effect);
  // The effects' coordinates stand last in the covariance, in order; those with a range only.
  Eigen::Index at = fit.covariance.rows();
  for (std::size_t e = fit.effects.size(); e-- > position;)
    for (const Bounds& b : fit.effects[e].bounds) at -= b.minimum < b.maximum;
  result.least = candidate.family != "stuck";
  for (std::size_t p = 0; p < candidate.effect.parameters.size(); ++p) {
    const double value = candidate.effect.parameters[p];
    result.parameters[type->parameters[p].name] = value;
    if (!is_shape(type->parameters[p])) result.least = result.least && near_least(candidate, type->parameters[p], p);
    if (candidate.bounds[p].minimum >= candidate.bounds[p].maximum) continue;
    const double place = candidate.to_coordinate(p, value);
    if (std::abs(place - 0.5) > 0.5 - options.bound_coordinate) result.at_bounds.push_back(type->parameters[p].name);
    if (fit.covariance.rows() == 0) continue;
    const double between = static_cast<Eigen::Index>(p) < apart.size() ? apart[static_cast<Eigen::Index>(p)] : 0.0;
    const double std = std::sqrt(std::max(0.0, fit.covariance(at, at)) + between * between);
    ++at;
    result.intervals[type->parameters[p].name] = {candidate.from_coordinate(p, place - width * std),
                                                  candidate.from_coordinate(p, place + width * std)};
  }
  return result;
}

bool same_cause(const NamedEffect& a, const NamedEffect& b) { return a.effect == b.effect && a.port == b.port; }

}  // namespace

std::string kind_of(const Datasheet& sheet, const std::string& port) {
  return sheet.port(port).kind == PortKind::sensor ? "sensor" : "process";
}

std::vector<RankedCause> rank_causes(const GapTrials& work, const EffectSearch& search) {
  const GapOptions::Verdict& options = work.options().verdict;
  std::vector<RankedCause> result;
  if (search.ranked.empty()) return result;
  // The one that was taken stands first, though another may be ahead over segments (effect_search.cpp): that is level.
  std::vector<const Structure*> structures;
  for (const Structure& s : search.ranked) structures.push_back(&s);
  if (const std::size_t first = position_of(search, 0); first < search.base.effects.size())
    std::stable_partition(structures.begin(), structures.end(), [&](const Structure* s) {
      return !s->score.empty() && same_effect(s->fit.effects.back(), search.base.effects[first]);
    });
  const Structure& best = *structures.front();
  const double whole = sum(search.plain.score) - sum(best.score);
  double weights = 0, last = 0;
  for (const Structure* structure : structures) {
    const Structure& s = *structure;
    RankedCause cause;
    cause.effect = named(s.fit, s.fit.effects.size() - 1, s.apart, work.ninety_percent(), options);
    if (!s.score.empty()) {
      const std::vector<double> behind = minus(s.score, best.score);
      cause.behind = std::max(0.0, sum(behind));
      cause.standard_error = work.standard_error(behind);
      last = cause.behind;
    } else {
      cause.behind = std::max(last, best.quick - s.quick);
      cause.followed = false;
      cause.standard_error = work.standard_error({cause.behind});
    }
    cause.gain = whole - cause.behind;
    const double scale = std::max({1.0, cause.standard_error, options.rival_gain_fraction * whole});
    cause.effect.probability = std::exp(-0.5 * std::pow(cause.behind / scale, 2));
    weights += cause.effect.probability;
    result.push_back(cause);
  }
  std::stable_sort(result.begin(), result.end(),
                   [](const RankedCause& a, const RankedCause& b) { return a.behind < b.behind; });
  for (RankedCause& cause : result) cause.effect.probability /= std::max(weights, 1e-300);
  return result;
}

std::vector<PlaceScore> rank_places(const Datasheet& sheet, const std::vector<Structure>& screened,
                                    const std::vector<RankedCause>& causes, double inseparable) {
  std::map<std::string, double> gains, shares;
  for (const Structure& s : screened) {
    double& gain = gains[s.fit.effects.back().effect.port];
    gain = std::max(gain, s.screened);
  }
  for (const RankedCause& cause : causes) shares[cause.effect.port] += cause.effect.probability;
  std::vector<PlaceScore> result;
  for (const auto& [port, gain] : gains) {
    PlaceScore place;
    place.port = port;
    place.component = sheet.port(port).component;
    place.kind = kind_of(sheet, port);
    place.score = gain;
    place.share = shares[port];
    result.push_back(place);
  }
  std::stable_sort(result.begin(), result.end(), [](const PlaceScore& a, const PlaceScore& b) {
    return a.share != b.share ? a.share > b.share : a.score > b.score;
  });
  for (std::size_t i = 1; i < result.size(); ++i)
    if (result[i].share > inseparable) result.front().inseparable.push_back(result[i].port);
  return result;
}

std::vector<PlaceScore> free_places(const Datasheet& sheet, const Discrepancy& discrepancy,
                                    const GapOptions::Verdict& options) {
  std::vector<PlaceScore> result;
  double sum = 0, most = 0;
  for (const FreePlace& free : discrepancy.places) most = std::max(most, free.gain);
  const double scale = std::max(1.0, options.rival_gain_fraction * most);
  for (const FreePlace& free : discrepancy.places) {
    PlaceScore place;
    place.port = free.port;
    place.component = sheet.port(free.port).component;
    place.kind = kind_of(sheet, free.port);
    place.score = free.gain;
    // The first one may have been put before one that wins a little more (discrepancy.h).
    const double behind = result.empty() ? 0 : most - free.gain;
    place.share = std::exp(-0.5 * std::pow(behind / scale, 2));
    sum += place.share;
    result.push_back(place);
  }
  for (PlaceScore& place : result) place.share /= sum;
  for (std::size_t i = 1; i < result.size(); ++i)
    if (result[i].share > options.place_probability * result.front().share)
      result.front().inseparable.push_back(result[i].port);
  return result;
}

void name_effects(const EffectSearch& search, double ninety, const GapOptions::Verdict& options, GapResult& result) {
  for (std::size_t round = 0; round < search.round_of.size(); ++round) {
    const std::size_t e = position_of(search, round);
    NamedEffect effect = named(search.base, e, search.apart[e], ninety, options);
    effect.probability = 1;
    if (round == 0)
      for (RankedCause& cause : result.ranked)
        if (same_cause(cause.effect, effect)) {
          effect.probability = cause.effect.probability;
          // One size for one cause: that of its trial was not fitted to the end.
          if (search.round_of.size() == 1) cause.effect = effect;
        }
    result.effects.push_back(effect);
  }
  const auto add = [&](NamedEffect rival, std::size_t round) {
    for (const auto* told : {&result.effects, &result.equivalent})
      if (std::any_of(told->begin(), told->end(), [&](const NamedEffect& e) { return same_cause(e, rival); })) return;
    rival.instead_of = result.effects[round].effect + "@" + result.effects[round].port;
    result.equivalent.push_back(std::move(rival));
  };
  if (result.effects.empty()) return;
  for (const RankedCause& cause : result.ranked)
    if (cause.behind < options.rival_standard_errors * cause.standard_error ||
        cause.behind < options.rival_gain_fraction * result.ranked.front().gain)
      add(cause.effect, 0);
  for (std::size_t round = 1; round < result.effects.size(); ++round) {
    double weights = 1;
    for (const Rival& rival : search.rivals) {
      if (rival.round != round) continue;
      NamedEffect effect = named(rival.fit, rival.fit.effects.size() - 1, rival.apart, ninety, options);
      effect.probability = std::exp(-0.5 * std::pow(rival.behind / std::max(1.0, rival.standard_error), 2));
      weights += effect.probability;
      if (rival.behind < options.rival_standard_errors * rival.standard_error) add(std::move(effect), round);
    }
    result.effects[round].probability /= weights;
    const std::string name = result.effects[round].effect + "@" + result.effects[round].port;
    for (NamedEffect& effect : result.equivalent)
      if (effect.instead_of == name) effect.probability /= weights;
  }
  if (!result.equivalent.empty())
    result.why_equivalent =
        fmt::format("on the held-out data they explain the gap as well, within {:g} standard errors",
                    options.rival_standard_errors);
}

}  // namespace faultline

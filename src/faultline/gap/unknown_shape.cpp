#include "faultline/gap/unknown_shape.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace faultline {
namespace {

constexpr double kOrdinateRange = 3;  // of the largest ordinate, on both sides, in which the fit may move all

Candidate fixed(Candidate candidate) {
  for (std::size_t p = 0; p < candidate.bounds.size(); ++p)
    candidate.bounds[p] = {candidate.effect.parameters[p], candidate.effect.parameters[p]};
  return candidate;
}

// A curve whose ordinates move.
Candidate moving(const std::string& port, const SignalCurve& curve) {
  Candidate candidate;
  candidate.effect = curve_effect(port, curve);
  for (const double value : candidate.effect.parameters) candidate.bounds.push_back({value, value});
  double largest = 0;
  for (const double value : curve.value) largest = std::max(largest, std::abs(value));
  for (std::size_t p = candidate.bounds.size() - kCurveNodes; p < candidate.bounds.size(); ++p)
    candidate.bounds[p] = {-kOrdinateRange * largest, kOrdinateRange * largest};
  return candidate;
}

}  // namespace

MissingSignal unknown_shape(GapTrials& work, const EffectSearch& search, bool names, double excess,
                            std::vector<std::string>& remarks) {
  const FreePlace place = (names ? search.after : search.before).places.front();
  ModelChange beside = names ? search.base.model : search.plain.fit.model;
  // The refit bent the parameters to what is missing.
  if (!names) beside.parameters = work.model().sheet().nominal();
  const auto reconstruct = [&] {
    MissingSignal found = find_missing_signal(work.model(), beside, place, work.folds(), work.jobs());
    found.beside = names ? "explained" : "refit";
    return found;
  };
  const MissingSignal first = reconstruct();
  if (!first.adoptable) {
    remarks.push_back("no function of what passes " + place.port +
                      " explains what is missing there: there is no curve to adopt");
    return first;
  }
  std::vector<Candidate> effects;
  if (names)
    for (const Candidate& known : search.base.effects) effects.push_back(fixed(known));
  effects.push_back(moving(place.port, *first.adoptable));
  const FitResult fit = work.refit(beside, effects);
  const double shrink = 1 - mean_excess(work.held_out(fit.model), work.held_out_values()) / std::max(excess, 1e-9);
  beside.parameters = fit.model.parameters;
  MissingSignal result = reconstruct();
  result.adopted_shrink = shrink;
  result.adoptable = first.adoptable;
  const std::vector<double>& fitted = fit.effects.back().effect.parameters;
  std::copy(fitted.end() - kCurveNodes, fitted.end(), result.adoptable->value.begin());
  result.parameters = fit.model.parameters;
  if (shrink > work.options().verdict.material_shrink_fraction) return result;
  remarks.push_back(fmt::format("the curve over {} closes {:.0f} % of what is left: there is none to adopt",
                                result.adoptable->variable, 100 * shrink));
  result.adoptable.reset();
  return result;
}

}  // namespace faultline

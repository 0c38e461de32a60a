#include "faultline/gap/unknown_shape.h"

#include <algorithm>
#include <cmath>
#include <optional>

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

// What was fitted from one start.
struct Adopted {
  SignalCurve curve;
  SignalPoints points;
  std::vector<double> parameters;
  double shrink = 0;
};

// A curve at a place together with the parameters, effects as they are. Empty: none explains anything.
std::optional<Adopted> adopt_curve(GapTrials& work, const ModelChange& start, const std::vector<Candidate>& effects,
                                   const FreePlace& place, double excess) {
  const MissingSignal found =
      find_missing_signal(work.model(), start, place, work.folds(), work.jobs(), Sought::adoptable);
  if (!found.adoptable) return {};
  std::vector<Candidate> with;
  for (const Candidate& known : effects) with.push_back(fixed(known));
  with.push_back(moving(place.port, *found.adoptable));
  const FitResult fit = work.refit(start, with);
  const std::vector<double>& fitted = fit.effects.back().effect.parameters;
  Adopted result{*found.adoptable, found.points, fit.model.parameters, 0};
  std::copy(fitted.end() - kCurveNodes, fitted.end(), result.curve.value.begin());
  result.shrink = 1 - mean_excess(work.held_out(fit.model), work.held_out_values()) / std::max(excess, 1e-9);
  return result;
}

}  // namespace

MissingSignal unknown_shape(GapTrials& work, const EffectSearch& search, bool names, double excess,
                            std::vector<std::string>& remarks) {
  const FreePlace place = (names ? search.after : search.before).places.front();
  ModelChange beside = names ? search.base.model : search.plain.fit.model;
  // The refit bent the parameters to what is missing; but a rig may be far from its datasheet.
  std::vector<std::vector<double>> starts = {beside.parameters};
  if (!names) starts.insert(starts.begin(), work.model().sheet().nominal());
  std::optional<Adopted> adopted;
  for (const std::vector<double>& parameters : starts) {
    ModelChange start = beside;
    start.parameters = parameters;
    adopted = adopt_curve(work, start, names ? search.base.effects : std::vector<Candidate>(), place, excess);
    if (adopted && adopted->shrink > work.options().verdict.material_shrink_fraction) break;
    adopted.reset();
  }
  if (adopted)
    beside.parameters = adopted->parameters;
  else
    remarks.push_back("no curve over what passes " + place.port + " closes the gap: there is none to adopt");
  MissingSignal result = find_missing_signal(work.model(), beside, place, work.folds(), work.jobs());
  result.beside = names ? "explained" : "refit";
  result.adoptable.reset();
  if (!adopted) return result;
  result.adoptable = adopted->curve;
  if (!result.curve) {  // nothing explained as much once more
    result.curve = adopted->curve;
    result.points = adopted->points;
  }
  result.parameters = adopted->parameters;
  result.adopted_shrink = adopted->shrink;
  return result;
}

}  // namespace faultline

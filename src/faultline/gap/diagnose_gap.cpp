#include "faultline/gap/diagnose_gap.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include <fmt/format.h>

#include "faultline/gap/gap_trials.h"
#include "faultline/gap/grid_step.h"
#include "faultline/gap/measure.h"
#include "faultline/gap/next_run.h"
#include "faultline/rig/random.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr std::size_t kSegment = 250;   // samples
constexpr std::size_t kFinalists = 10;  // candidates that are fitted after screening ...
constexpr std::size_t kSurvivors = 3;   // ... and of those followed to the end,
constexpr double kFollow = 0.4;         // if they win this share of what the best one wins
constexpr double kSignificance = 3;     // standard errors that a gain must exceed
constexpr double kMaterial = 0.04;      // share of the mean squared residual that a first effect must remove
constexpr double kMaterialNext = 0.10;  // ... and a further one
constexpr double kDecisive = 0.4;       // ... or this share of the excess, either of them
constexpr double kQuiet = 0.05;         // excess below which there is nothing left to explain, at the datasheet's noise
constexpr double kQuietShare = 0.02;    // ... plus this share of what there was
constexpr double kNoisy = 0.2;          // share of that which is left where the recording is much noisier
constexpr double kUnexplained = 3;      // times the quiet excess: something that no effect explains is worth a word
constexpr double kRefitMatters = 0.05;  // excess that the refit must remove to speak of miscalibration
constexpr double kLeft = 0.07;          // share of the refit's excess that may be left beyond that floor
constexpr double kStrain = 70;          // squared tolerances, summed over the parameters, that are as doubtful
constexpr double kSteepness = 4;        // of the doubt's logistic curve
constexpr double kEnough = 0.55;        // share of the excess that named effects must close, else "unknown"
constexpr double kEnoughOfClosure =
    0.6;  // share of what all effects at the place together win that the named ones must win
constexpr double kNextDuration = 20;  // s
constexpr double kRivalErrors = 2;    // standard errors within which a rival cannot be told apart
constexpr double kRivalShare = 0.02;  // ... or this share of the gain
constexpr double kInterval =
    1.645 * 1.5;  // 90 %; half as wide again for what small unmodelled things shift (development cases)
constexpr int kBootstraps = 400;

NamedEffect named(const FitResult& fit, std::size_t position) {
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
  for (std::size_t p = 0; p < candidate.effect.parameters.size(); ++p) {
    const double value = candidate.effect.parameters[p];
    result.parameters[type->parameters[p].name] = value;
    if (candidate.bounds[p].minimum >= candidate.bounds[p].maximum || fit.covariance.rows() == 0) continue;
    const double std = std::sqrt(std::max(0.0, fit.covariance(at, at)));
    ++at;
    const double c = candidate.to_coordinate(p, value);
    result.intervals[type->parameters[p].name] = {candidate.from_coordinate(p, c - kInterval * std),
                                                  candidate.from_coordinate(p, c + kInterval * std)};
  }
  return result;
}

// Excess that small unmodelled things leave where nothing is missing. They have a size of their own, so the noisier the recording against
// the datasheet's noise, the less of them is seen.
double quiet_excess(const ResidualModel& model) {
  double ratio = 0;
  int count = 0;
  for (std::size_t i = 0; i < model.outputs().size(); ++i) {
    const Channel& channel = model.sheet().channels[static_cast<std::size_t>(model.outputs()[i])];
    if (channel.noise_std <= 0) continue;
    ratio += model.noise()[i] / channel.noise_std;
    ++count;
  }
  return kQuiet * (kNoisy + (1 - kNoisy) / std::max(1.0, count > 0 ? ratio / count : 1.0));
}

std::string kind_of(const Datasheet& sheet, const std::string& port) {
  return sheet.port(port).kind == PortKind::sensor ? "sensor" : "process";
}

std::vector<GapRun> cut_in_two(const Datasheet& sheet, const GapRun& run) {
  std::vector<GapRun> parts;
  const std::size_t rows = run.recording.rows();
  const std::size_t middle = rows / 2;
  for (int half = 0; half < 2; ++half) {
    Recording part;
    part.rig = run.recording.rig;
    part.channels = run.recording.channels;
    for (std::size_t k = half ? middle : 0; k < (half ? rows : middle); ++k) part.append(run.recording.sample(k));
    parts.push_back(prepare_run(sheet, run.name + (half ? " (second half)" : " (first half)"), std::move(part),
                                gap_segment(sheet)));
  }
  return parts;
}

}  // namespace

std::size_t gap_segment(const Datasheet&) { return kSegment; }

GapResult diagnose_gap(const Datasheet& sheet, std::vector<GapRun> runs, std::vector<GapRun> holdout,
                       const GapSettings& settings, const GapProgress& progress) {
  const auto begin = std::chrono::steady_clock::now();
  GapResult result;
  result.rig = sheet.rig;
  for (const GapRun& run : runs) result.runs.push_back(run.name);
  for (const GapRun& run : holdout) result.holdout.push_back(run.name);

  if (runs.empty()) throw InputError("gap: no run was given");
  if (runs.size() == 1 && holdout.empty()) {
    if (runs.front().recording.rows() < 4 * gap_segment(sheet))
      throw InputError(fmt::format("{}: too short to be cut in two; a single run needs at least {:g} s",
                                   runs.front().name,
                                   static_cast<double>(4 * gap_segment(sheet)) * sheet.sample_period));
    runs = cut_in_two(sheet, runs.front());
  }
  std::vector<Fold> folds;
  std::vector<std::size_t> learn;
  const std::size_t learning = runs.size();
  if (!holdout.empty()) {
    Fold fold;
    for (std::size_t i = 0; i < learning; ++i) fold.train.push_back(i);
    for (std::size_t i = 0; i < holdout.size(); ++i) fold.test.push_back(learning + i);
    folds.push_back(fold);
    learn = fold.train;
    for (GapRun& run : holdout) runs.push_back(std::move(run));
  } else {
    Fold even, odd;
    for (std::size_t i = 0; i < learning; ++i) {
      (i % 2 ? odd : even).train.push_back(i);
      (i % 2 ? even : odd).test.push_back(i);
      learn.push_back(i);
    }
    folds = {even, odd};
  }

  GapTrials work(sheet, std::move(runs), folds, learn, settings, progress);
  const double values = work.held_out_values();
  const auto excess = [&](const std::vector<double>& losses) { return std::max(0.0, 2 * sum(losses) / values - 1); };
  // Of a typical segment: a few that go astray (a breakaway a moment too late) are no evidence that something is missing.
  const auto typical = [&](const std::vector<double>& scores) {
    return std::expm1(std::max(0.0, 2 * sum(scores) / values));
  };

  const double quiet = quiet_excess(work.model());
  work.tell(0.02, "refitting parameters");
  GapModel nominal;
  nominal.parameters = sheet.nominal();
  FitResult base = work.refit(nominal, {});
  const GapModel refitted = base.model;
  const std::vector<double> nominal_losses = work.held_out(nominal);
  const Structure plain = work.score(base);  // the refitted model, scored like every other
  const std::vector<double>& refit_losses = plain.held_out;
  const double refit_excess = excess(refit_losses), nominal_excess = excess(nominal_losses);

  std::vector<Structure> first_ranked, screened_first;
  std::vector<double> now_losses = refit_losses, now_score = plain.score;
  for (int round = 0; round < settings.most_effects; ++round) {
    if (typical(now_score) < quiet + (round > 0 ? kQuietShare * typical(plain.score) : 0)) break;
    const double from = round == 0 ? 0.1 : 0.55 + 0.18 * (round - 1), width = round == 0 ? 0.45 : 0.18;
    std::vector<Structure> structures = work.screen(base, from, from + 0.5 * width);
    if (round == 0) screened_first = structures;
    if (structures.empty()) break;
    if (structures.size() > kFinalists) structures.resize(kFinalists);
    work.shortlist(base, structures, from + 0.5 * width, from + 0.65 * width);
    std::size_t kept = 1;
    while (kept < structures.size() && kept < kSurvivors && structures[kept].quick > kFollow * structures.front().quick)
      ++kept;
    const std::vector<Structure> rest(structures.begin() + static_cast<std::ptrdiff_t>(kept), structures.end());
    structures.resize(kept);
    work.refine(structures, from + 0.65 * width, from + width);
    std::stable_sort(structures.begin(), structures.end(),
                     [](const Structure& a, const Structure& b) { return sum(a.score) < sum(b.score); });
    const Structure best = structures.front();
    for (Structure& structure : structures)
      structure.around = {};  // only the best one's are needed, and they are large
    if (round == 0) {
      first_ranked = structures;
      first_ranked.insert(first_ranked.end(), rest.begin(), rest.end());
    }
    const std::vector<double> gain = minus(now_score, best.score);
    // Mean over the segments of the log of their loss: the share by which a typical segment shrinks.
    const double share = 1 - std::exp(-sum(gain) / (0.5 * values));
    const bool significant = sum(gain) > kSignificance * standard_error(gain);
    // Some effects (a breakaway level) show in a few segments only, but there decide the mean.
    const double before = excess(now_losses), after = excess(best.held_out);
    const bool decisive = before - after > kDecisive * before && before - after > quiet;
    if (!significant || (!decisive && share < (round == 0 ? kMaterial : kMaterialNext))) break;
    base = work.refit(best);
    base.covariance = best.fit.covariance;
    // A further effect must not be credited with what one more refit wins.
    const Structure again = work.score(base);
    const Structure& better = sum(again.score) < sum(best.score) ? again : best;
    now_losses = better.held_out;
    now_score = better.score;
  }
  // What all the library's effects at the place could win together.
  double closure_gain = 0, named_gain = 0;
  if (!base.effects.empty()) {
    work.tell(0.88, "fitting a flexible model");
    const Structure closure = work.closure(base, base.effects.front().effect.port);
    if (!closure.score.empty()) closure_gain = sum(plain.score) - sum(closure.score);
    named_gain = sum(plain.score) - sum(now_score);
    closure_gain = std::max(closure_gain, named_gain);
  }
  work.tell(0.93, "measuring the gap");

  const double explained_excess = excess(now_losses);
  result.shrink_refit = refit_excess > 0 ? 1 - explained_excess / refit_excess : 0;
  result.shrink_nominal = nominal_excess > 0 ? 1 - explained_excess / nominal_excess : 0;
  if (base.effects.empty()) result.shrink_refit = 0;
  Random random(settings.seed);
  std::vector<double> shrinks;
  for (int b = 0; b < kBootstraps && refit_excess > 0; ++b) {
    double before = 0, after = 0;
    for (std::size_t i = 0; i < refit_losses.size(); ++i) {
      const auto k = static_cast<std::size_t>(random.uniform() * static_cast<double>(refit_losses.size()));
      before += refit_losses[k];
      after += now_losses[k];
    }
    const double e1 = 2 * before / values - 1, e2 = std::max(0.0, 2 * after / values - 1);
    if (e1 > 0) shrinks.push_back(1 - e2 / e1);
  }
  std::sort(shrinks.begin(), shrinks.end());
  if (!shrinks.empty())
    result.shrink_interval = {shrinks[shrinks.size() / 20], shrinks[shrinks.size() - 1 - shrinks.size() / 20]};

  // Ranked causes and rivals of the first effect. Those that were not followed to the end are as far behind as their quick fits.
  double weights = 0, last = 0;
  for (const Structure& s : first_ranked) {
    RankedCause cause;
    cause.effect = named(s.fit, s.fit.effects.size() - 1);
    if (!s.score.empty()) {
      const std::vector<double> behind = minus(s.score, first_ranked.front().score);
      cause.gain = sum(plain.score) - sum(s.score);
      cause.behind = sum(behind);
      cause.standard_error = standard_error(behind);
      last = cause.behind;
    } else {
      cause.behind = std::max(last, first_ranked.front().quick - s.quick);
      cause.gain = sum(plain.score) - sum(first_ranked.front().score) - cause.behind;
      cause.standard_error = standard_error({cause.behind});
    }
    const double scale =
        std::max({1.0, cause.standard_error, kRivalShare * (sum(plain.score) - sum(first_ranked.front().score))});
    cause.effect.probability = std::exp(-0.5 * std::pow(cause.behind / scale, 2));
    weights += cause.effect.probability;
    result.ranked.push_back(cause);
  }
  std::stable_sort(result.ranked.begin(), result.ranked.end(),
                   [](const RankedCause& a, const RankedCause& b) { return a.behind < b.behind; });
  for (RankedCause& cause : result.ranked) cause.effect.probability /= std::max(weights, 1e-300);

  // Places: the best candidate of each port.
  std::map<std::string, double> place_gain;
  for (const Structure& s : screened_first) {
    double& gain = place_gain[s.fit.effects.back().effect.port];
    gain = std::max(gain, s.screened);
  }
  std::map<std::string, double> place_share;
  for (const RankedCause& cause : result.ranked) place_share[cause.effect.port] += cause.effect.probability;
  for (const auto& [port, gain] : place_gain) {
    PlaceScore place;
    place.port = port;
    place.component = sheet.port(port).component;
    place.kind = kind_of(sheet, port);
    place.score = gain;
    const auto share = place_share.find(port);
    place.share = share == place_share.end() ? 0 : share->second;
    result.places.push_back(place);
  }
  std::stable_sort(result.places.begin(), result.places.end(), [](const PlaceScore& a, const PlaceScore& b) {
    return a.share != b.share ? a.share > b.share : a.score > b.score;
  });
  if (!result.places.empty())
    for (std::size_t i = 1; i < result.places.size(); ++i)
      if (result.places[i].share > 0.15) result.places.front().inseparable.push_back(result.places[i].port);

  const bool found = !base.effects.empty();
  if (found) {
    for (std::size_t e = 0; e < base.effects.size(); ++e) {
      NamedEffect effect = named(base, e);
      for (const RankedCause& cause : result.ranked)
        if (cause.effect.effect == effect.effect && cause.effect.port == effect.port)
          effect.probability = cause.effect.probability;
      if (e > 0) effect.probability = 1;
      result.effects.push_back(effect);
    }
    for (std::size_t i = 1; i < result.ranked.size(); ++i) {
      const RankedCause& cause = result.ranked[i];
      if (cause.behind < kRivalErrors * cause.standard_error || cause.behind < kRivalShare * result.ranked.front().gain)
        result.equivalent.push_back(cause.effect);
    }
    if (!result.equivalent.empty())
      result.why_equivalent =
          fmt::format("on the held-out data they explain the gap as well, within {:g} standard errors", kRivalErrors);
  }
  result.closable = found && closure_gain > 0 ? std::clamp(named_gain / closure_gain, 0.0, 1.0) : 0;
  // Doubt that what was found is the cause, or that nothing need be found: what is left, and how far the parameters had to bend for it.
  double strain = 0;
  for (std::size_t i = 0; i < sheet.parameters.size(); ++i)
    if (sheet.parameters[i].tolerance > 0)
      strain +=
          std::pow((base.model.parameters[i] / sheet.parameters[i].nominal - 1) / sheet.parameters[i].tolerance, 2);
  double doubt = 0;
  if (found) {
    doubt = std::max(0.0, typical(now_score) - quiet) / std::max(typical(plain.score), 1e-9) / kLeft + strain / kStrain;
    if (result.shrink_refit < kEnough || result.closable < kEnoughOfClosure) doubt += 1;
  } else {
    doubt = typical(plain.score) / (kUnexplained * quiet);
  }
  result.unknown_probability = 1 / (1 + std::exp(-kSteepness * (doubt - 1)));
  if (doubt > 1)
    result.verdict = "unknown";
  else if (found)
    result.verdict = "named";
  else
    result.verdict = nominal_excess - refit_excess > kRefitMatters ? "miscalibrated" : "none";
  if (result.verdict == "none" || result.verdict == "miscalibrated") {
    // What little the best effect wins is not claimed; the measures stay those of the refit.
    base.effects.clear();
    base.model = refitted;
    result.effects.clear();
    result.equivalent.clear();
    result.shrink_refit = 0;
    result.shrink_interval = {};
    result.closable = 0;
  }
  // Rounding is in the noise, so it is beside all this: a fact of the recording.
  const std::vector<NamedEffect> rounded = rounded_channels(sheet, work.model().runs(), settings.without);
  if (!rounded.empty() && result.verdict != "unknown") {
    if (result.effects.empty()) {
      PlaceScore place;
      place.port = rounded.front().port;
      place.component = sheet.port(place.port).component;
      place.kind = "sensor";
      place.share = 1;
      result.places = {place};
    }
    result.verdict = "named";
    result.effects.insert(result.effects.end(), rounded.begin(), rounded.end());
  }
  result.where_kind = result.verdict == "none" || result.verdict == "miscalibrated" || result.places.empty()
                          ? "none"
                          : result.places.front().kind;

  if (result.verdict == "named" && !result.equivalent.empty()) {
    work.tell(0.95, "looking for a run that separates");
    const NamedEffect& rival = result.equivalent.front();
    const auto model_of = [&](const NamedEffect& wanted) -> const FitResult& {
      for (const Structure& s : first_ranked)
        if (s.fit.effects.back().effect.effect == wanted.effect && s.fit.effects.back().effect.port == wanted.port)
          return s.fit;
      return base;
    };
    const NamedEffect& best = result.ranked.front().effect;
    result.next = separating_runs(sheet, model_of(best).model, model_of(rival).model,
                                  best.effect + "@" + best.port + " and " + rival.effect + "@" + rival.port,
                                  gap_segment(sheet), kNextDuration, settings.jobs);
  }
  measure_levels(work.model(), nominal, refitted, base, result);
  describe(sheet, result);
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return result;
}

}  // namespace faultline

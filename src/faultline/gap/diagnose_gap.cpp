#include "faultline/gap/diagnose_gap.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <mutex>

#include <fmt/format.h>

#include "faultline/gap/diagnose_runs.h"
#include "faultline/gap/diagnose_since.h"
#include "faultline/gap/slow_drift.h"
#include "faultline/gap/told_bounds.h"

namespace faultline {
namespace {

constexpr double kFirstShare = 0.96;  // of the progress, before it is asked since when

// Parameters that lie as far from the datasheet as they may beside the causes of an answer, if it has any.
std::vector<std::string> at_bounds_of(const Datasheet& sheet, const GapResult& result, const GapOptions& options) {
  return at_bounds(sheet, result.gap[result.effects.empty() ? 1 : 2], options);
}

// Step 6: causes that are found where the parameters stay within `bound` tolerances of the datasheet, which `settings`
// are told then. Nothing where none are, or such as win little and let no parameters go back. Beside those of `before`
// it takes one more, or others that let parameters go back or leave much less. So near to the datasheet that a rig in
// order may lie beyond, they must let parameters go back.
std::optional<GapResult> diagnose_within(const Datasheet& sheet, const std::vector<SegmentedRun>& runs,
                                         const std::vector<SegmentedRun>& holdout, GapSettings& settings,
                                         const GapProgress& progress, const GapResult& before,
                                         const std::vector<std::string>& far, double bound) {
  const GapOptions::Nearer& options = settings.options.nearer;
  GapSettings nearer = settings;
  nearer.options.linearisation.parameter_bound_tolerances = bound;
  // What bent parameters hide shows over segments only: there it is known by what it lets go back.
  const bool silent = before.verdict == "none" || before.verdict == "miscalibrated";
  const bool nearest = bound <= options.nearest_tolerances;
  if (before.verdict == "miscalibrated" || nearest) {
    nearer.options.search.evidence_fraction = nearer.options.verdict.material_evidence_fraction = -1;
    nearer.options.verdict.small_gap_shrink_fraction = options.shrink_fraction;
  }
  if (nearest) {
    GapOptions::Search& search = nearer.options.search;
    search.least_free_fraction = search.further_free_fraction = 0;
    search.further_evidence_fraction = -1;
  }
  GapResult result = diagnose_runs(sheet, sheet, runs, holdout, nearer, progress, Wanted::name);
  if (result.verdict != "named") return std::nullopt;
  const GapLevel &was = before.gap[silent ? 1 : 2], &is = result.gap[2];
  const double left = is.excess, left_before = was.excess;
  if (!silent && left > options.left_ratio * left_before) return std::nullopt;
  const GapOptions::Verdict& verdict = settings.options.verdict;
  const bool go_back = left <= options.left_ratio * left_before &&
                       prior_loss(sheet, was) - prior_loss(sheet, is) > options.relief_log_likelihood;
  const bool likely =
      !nearest && result.evidence.effects > verdict.material_evidence_fraction * result.evidence.perfect &&
      std::max(result.evidence.shrink, result.evidence.typical_shrink) >= verdict.small_gap_shrink_fraction;
  const bool more = result.effects.size() > before.effects.size(), better = left < options.better_ratio * left_before;
  if (!go_back && !(likely && (silent || more || better))) return std::nullopt;
  result.remarks.push_back(
      fmt::format("a refit {} explains {} only with {} {:.2g} tolerances from the datasheet at once",
                  silent ? "without a cause"
                  : more ? "with fewer causes"
                         : "with other causes",
                  silent ? "the runs" : "what it does", fmt::join(far, ", "),
                  settings.options.linearisation.parameter_bound_tolerances));
  settings.options.linearisation.parameter_bound_tolerances = bound;
  return result;
}

// Step 6, as long as parameters lie at their bounds; the nearest must tell more causes than what stands, and leave no
// more. Nothing where the first answer stands.
std::optional<GapResult> diagnose_nearer(const Datasheet& sheet, const std::vector<SegmentedRun>& runs,
                                         const std::vector<SegmentedRun>& holdout, GapSettings& settings,
                                         const GapProgress& progress, const GapResult& before) {
  const GapOptions::Nearer& options = settings.options.nearer;
  const std::vector<std::string> far = at_bounds_of(sheet, before, settings.options);
  if (far.size() < options.at_bounds) return std::nullopt;
  if (progress) progress(0, "asking again with parameters nearer to the datasheet");
  GapSettings near = settings, nearest = settings;
  std::optional<GapResult> result =
      diagnose_within(sheet, runs, holdout, near, progress, before, far, options.bound_tolerances);
  const bool bent = !result || at_bounds_of(sheet, *result, near.options).size() >= options.at_bounds;
  const bool to_relieve = prior_loss(sheet, before.gap[before.effects.empty() ? 1 : 2]) > options.relief_log_likelihood;
  if (bent && to_relieve) {
    std::optional<GapResult> more =
        diagnose_within(sheet, runs, holdout, nearest, progress, before, far, options.nearest_tolerances);
    const GapResult& standing = result ? *result : before;
    if (more && more->effects.size() > standing.effects.size() &&
        (!result || more->gap[2].excess <= result->gap[2].excess)) {
      settings = nearest;
      return more;
    }
  }
  if (result) settings = near;
  return result;
}

// Step 6. The answer without those causes of `before` that have next to no size beside the others, which are then left
// out of `settings`; nothing where none has, or where that leaves more.
std::optional<GapResult> diagnose_without(const Datasheet& sheet, const std::vector<SegmentedRun>& runs,
                                          const std::vector<SegmentedRun>& holdout, GapSettings& settings,
                                          const GapProgress& progress, const GapResult& before) {
  GapSettings fewer = settings;
  for (const NamedEffect& effect : before.effects)
    if (effect.least) fewer.without.push_back(effect.effect + "@" + effect.port);
  const std::size_t left_out = fewer.without.size() - settings.without.size();
  if (before.verdict != "named" || left_out == 0 || left_out == before.effects.size()) return std::nullopt;
  GapResult result = diagnose_runs(sheet, sheet, runs, holdout, fewer, progress, Wanted::name);
  if (result.verdict != "named" || result.gap[2].excess > settings.options.nearer.left_ratio * before.gap[2].excess)
    return std::nullopt;
  settings = fewer;
  return result;
}

// Step 9. Nothing where no cause is told, or another one comes first than the one that was told as a part.
std::optional<GapResult> diagnose_shorter(const Datasheet& sheet, const std::vector<SegmentedRun>& runs,
                                          const std::vector<SegmentedRun>& holdout, const GapSettings& settings,
                                          const GapProgress& progress, const GapResult& before) {
  const GapOptions::Shorter& options = settings.options.shorter;
  const std::size_t rows = std::min(fewest_rows(runs), holdout.empty() ? SIZE_MAX : fewest_rows(holdout));
  if (rows < options.times * options.least_samples) return std::nullopt;
  const auto cut = [&](const std::vector<SegmentedRun>& list) {
    std::vector<SegmentedRun> result;
    for (const SegmentedRun& run : list)
      result.push_back(shorter_segments(sheet, run, options.times, settings.options.segments));
    return result;
  };
  const std::vector<SegmentedRun> learned = cut(runs);
  const double length = static_cast<double>(learned.front().segment) * learned.front().period;
  GapResult result = diagnose_runs(sheet, sheet, learned, cut(holdout), settings, progress, Wanted::name);
  if (result.verdict != "named") return std::nullopt;
  if (!before.effects.empty()) {
    const NamedEffect &first = result.effects.front(), &part = before.effects.front();
    if (first.effect != part.effect || first.port != part.port) return std::nullopt;
  }
  result.remarks.push_back(fmt::format(
      "all this is over segments of {:.3g} s, of which a usual one holds {}: over those the cause is unknown", length,
      options.times));
  return result;
}

// Step 7. Nothing where no such drift is told.
std::optional<GapResult> diagnose_drift(const Datasheet& sheet, const RunsAway& found, GapSettings settings,
                                        const GapProgress& progress) {
  const GapOptions::SlowDrift options = settings.options.slow_drift;
  for (const Port& port : sheet.ports)
    for (const FittingEffect& fitting : port.effects)
      if (fitting.effect != "drift" || port.name != found.port)
        settings.without.push_back(fitting.effect + "@" + port.name);
  // One candidate needs less evidence than the first of all.
  settings.most_effects = 1;
  settings.options.search.evidence_fraction = settings.options.verdict.material_evidence_fraction =
      options.evidence_fraction;
  settings.options.search.least_free_fraction = 0;  // what adds up is no signal that forgets
  if (progress) progress(0, "holding " + found.channel + " against its rate");
  GapResult result = diagnose_runs(sheet, sheet, found.runs, found.holdout, settings, progress, Wanted::name);
  if (result.verdict != "named" || result.effects.front().effect != "drift") return std::nullopt;
  const double off = std::abs(result.effects.front().parameters.at("rate") - found.apart.rate);
  if (off > std::max(options.agreement_fraction * std::abs(found.apart.rate),
                     options.standard_errors * found.apart.standard_error))
    return std::nullopt;
  const SegmentedRun& run = found.runs.front();
  result.remarks.push_back(fmt::format(
      "all this is over segments of {:.3g} s, {} times as long as usual: within those the drift is less than "
      "the noise. {}",
      static_cast<double>(run.segment) * run.period, found.times, told(sheet, found)));
  return result;
}

}  // namespace

GapResult diagnose_gap(const Datasheet& sheet, std::vector<SegmentedRun> runs, std::vector<SegmentedRun> holdout,
                       const GapSettings& settings, const GapProgress& progress) {
  const auto begin = std::chrono::steady_clock::now();
  // A search that begins again does not take the progress back.
  std::mutex guard;
  double furthest = 0;
  GapProgress forward, again;
  if (progress) {
    forward = [&](double done, const std::string& text) {
      const std::lock_guard<std::mutex> lock(guard);
      furthest = std::max(furthest, done);
      progress(furthest, text);
    };
    again = [&](double done, const std::string& text) { forward(kFirstShare + (1 - kFirstShare) * done, text); };
  }
  GapSettings used = settings;
  GapResult result = diagnose_runs(sheet, sheet, runs, holdout, used, forward);
  if (std::optional<GapResult> fewer = diagnose_without(sheet, runs, holdout, used, again, result))
    result = std::move(*fewer);
  // Parameters may have taken the place of a cause, or of another one beside those that are told.
  if (result.verdict != "unknown") {
    if (std::optional<GapResult> nearer = diagnose_nearer(sheet, runs, holdout, used, again, result))
      result = std::move(*nearer);
  }
  const std::optional<RunsAway> away =
      what_runs_away(sheet, runs, holdout, settings.without, settings.options.slow_drift);
  std::optional<GapResult> drift;
  if (away && (result.verdict == "none" || result.verdict == "miscalibrated"))
    drift = diagnose_drift(sheet, *away, used, again);
  // What closes all from the beginning on did not begin, unless it is a stuck sensor, which takes a moment of its own.
  const bool closed = result.verdict == "named" &&
                      result.shrink_refit >= settings.options.verdict.closed_shrink_fraction &&
                      std::none_of(result.effects.begin(), result.effects.end(),
                                   [](const NamedEffect& e) { return e.effect == "stuck"; });
  if (drift) {
    result = std::move(*drift);
  } else if (result.verdict != "none" && !closed) {
    if (forward) forward(kFirstShare, "looking since when");
    std::string remark;
    const double left = result.gap[1].excess;
    if (std::optional<GapResult> since = diagnose_since(sheet, runs, holdout, used, again, left, remark)) {
      since->runs = std::move(result.runs);
      since->holdout = std::move(result.holdout);
      result = std::move(*since);
    } else if (result.verdict == "unknown" && !remark.empty()) {
      result.remarks.push_back(remark);
    }
  }
  if (result.verdict == "unknown") {
    if (forward) forward(kFirstShare, "asking again of shorter segments");
    if (std::optional<GapResult> shorter = diagnose_shorter(sheet, runs, holdout, used, again, result))
      result = std::move(*shorter);
  }
  if (away && std::none_of(result.effects.begin(), result.effects.end(),
                           [&](const NamedEffect& e) { return e.port == away->port; }))
    result.remarks.push_back(told(sheet, *away) + ": its transducer drifts, or that of the rate is offset");
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return result;
}

}  // namespace faultline

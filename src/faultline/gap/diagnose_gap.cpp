#include "faultline/gap/diagnose_gap.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <mutex>

#include <fmt/format.h>

#include "faultline/gap/effect_search.h"
#include "faultline/gap/measure.h"
#include "faultline/gap/next_run.h"
#include "faultline/gap/onset.h"
#include "faultline/gap/ranked_causes.h"
#include "faultline/gap/rounded_channels.h"
#include "faultline/gap/slow_drift.h"
#include "faultline/gap/split_runs.h"
#include "faultline/gap/stuck_times.h"
#include "faultline/gap/unknown_shape.h"
#include "faultline/gap/verdict.h"
#include "faultline/numerics/quantiles.h"
#include "faultline/numerics/random.h"
#include "faultline/rig/parameter_range.h"
#include "faultline/segments/own_start.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kFirstShare = 0.96;  // of the progress, before it is asked since when
constexpr double kMuchLeft = 1.5;     // times the noise
constexpr double kMuchNoise = 10;     // times the datasheet's
constexpr double kShifted =
    0.1;  // of what is closed, by which other outputs may be worse: one wrong name's are by 0.15

// Excess that small unmodelled things leave where nothing is missing. They have a size of their own, so the noisier
// the recording against the datasheet's noise, the less of them is seen.
double quiet_excess(const ResidualModel& model) {
  const GapOptions::Verdict& options = model.options().verdict;
  double ratio = 0;
  int count = 0;
  for (std::size_t i = 0; i < model.outputs().size(); ++i) {
    const Channel& channel = model.sheet().channels[static_cast<std::size_t>(model.outputs()[i])];
    if (channel.noise_std <= 0) continue;
    ratio += model.noise()[i] / channel.noise_std;
    ++count;
  }
  const double noisy = options.quiet_noisy_fraction;
  return options.quiet_excess_variances * (noisy + (1 - noisy) / std::max(1.0, count > 0 ? ratio / count : 1.0));
}

// Parameters that lie as far from the datasheet as they may.
std::vector<std::string> at_bounds(const Datasheet& sheet, const std::vector<double>& parameters,
                                   const GapOptions& options) {
  std::vector<std::string> names;
  const double highest = options.linearisation.parameter_bound_tolerances;
  for (std::size_t i = 0; i < sheet.parameters.size(); ++i) {
    const Parameter& p = sheet.parameters[i];
    if (p.tolerance <= 0) continue;
    const double z = (parameters[i] - p.nominal) / (p.nominal * p.tolerance);
    if (z >= 0.999 * highest || z <= 0.999 * lowest_deviation(p, highest)) names.push_back(p.name);
  }
  return names;
}

// The same in one sentence; empty: none.
std::string told_at_bounds(const Datasheet& sheet, const ModelChange& model, const GapOptions& options) {
  const std::vector<std::string> names = at_bounds(sheet, model.parameters, options);
  if (names.empty()) return {};
  const bool several = names.size() > 1;
  return fmt::format(
      "{} {} as far from the datasheet as {} may go, at most {:.2g} tolerances: correct the datasheet or its "
      "tolerance, unless what the model lacks bends {}",
      fmt::join(names, ", "), several ? "lie" : "lies", several ? "they" : "it",
      options.linearisation.parameter_bound_tolerances, several ? "them" : "it");
}

// Those of the refit alone.
std::vector<std::string> at_bounds(const Datasheet& sheet, const GapResult& result, const GapOptions& options) {
  std::vector<double> parameters = sheet.nominal();
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const auto factor = result.gap[1].parameters.find(sheet.parameters[i].name);
    if (factor != result.gap[1].parameters.end()) parameters[i] *= factor->second;
  }
  return at_bounds(sheet, parameters, options);
}

struct BeyondRange {
  std::size_t parameter;
  Bounds range;
};

// Parameters of an effect that lie beyond the datasheet's ranges; a time is no size.
std::vector<BeyondRange> beyond_range(const Datasheet& sheet, const Candidate& candidate) {
  std::vector<BeyondRange> result;
  const EffectType* type = find_effect_type(candidate.effect.effect);
  for (const FittingEffect& fitting : sheet.port(candidate.effect.port).effects) {
    if (fitting.effect != candidate.effect.effect || type->family == "stuck") continue;
    for (std::size_t p = 0; p < candidate.bounds.size(); ++p) {
      const auto range = fitting.bounds.find(type->parameters[p].name);
      const double value = candidate.effect.parameters[p];
      if (range != fitting.bounds.end() && (value < range->second.minimum || value > range->second.maximum))
        result.push_back({p, range->second});
    }
  }
  return result;
}

// Those of what was found in one sentence; empty: none.
std::string told_beyond_range(const Datasheet& sheet, const std::vector<Candidate>& effects) {
  std::string text;
  for (const Candidate& c : effects)
    for (const auto& [p, range] : beyond_range(sheet, c))
      text += fmt::format("{}{} of {}@{} ({:.4g}) lies beyond the datasheet's range, {:.4g} to {:.4g}",
                          text.empty() ? "" : "; ", find_effect_type(c.effect.effect)->parameters[p].name,
                          c.effect.effect, c.effect.port, c.effect.parameters[p], range.minimum, range.maximum);
  return text;
}

// Whether one of them lies at the end of what is tried.
bool at_farthest(const Datasheet& sheet, const Candidate& candidate, const GapOptions& options) {
  const std::vector<BeyondRange> beyond = beyond_range(sheet, candidate);
  return std::any_of(beyond.begin(), beyond.end(), [&](const BeyondRange& size) {
    const double place = candidate.to_coordinate(size.parameter, candidate.effect.parameters[size.parameter]);
    return std::abs(place - 0.5) > 0.5 - options.verdict.bound_coordinate;
  });
}

using Excess = double (*)(const std::vector<double>& segments, double values);

// 1 - excess(after)/excess(before)
double shrink_of(Excess excess, const std::vector<double>& before, const std::vector<double>& after, double values) {
  const double first = excess(before, values);
  return first > 0 ? 1 - excess(after, values) / first : 0;
}

// Its 90 % interval, by bootstrap over the segments.
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

// Gap beyond the noise over what the channels move.
double gap_size(const GapLevel& level) {
  double squares = 0;
  for (const ChannelGap& c : level.channels) {
    const double rms = c.rms.at("segment"), beyond = rms > 0 ? std::max(0.0, 1 - std::pow(c.noise_std / rms, 2)) : 0;
    squares += std::pow(c.nrmse.at("segment"), 2) * beyond;
  }
  return level.channels.empty() ? 0 : std::sqrt(squares / static_cast<double>(level.channels.size()));
}

// The most that is closed of what a level leaves in one output, of those where that is much. 0 where that is taken from
// others, as of what makes up for something else; by effects at sensors it must be nearly all, for they close their own
// channel whatever is wrong.
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
  const bool shifted = opened > kShifted * closed;
  return shifted || (sensor && most < options.closed_shrink_fraction) ? 0 : most;
}

// A verdict says which cause is seen, not that nothing is left. In words; empty: nothing.
std::string what_is_left(const GapLevel& level) {
  std::string left;
  for (const ChannelGap& gap : level.channels)
    if (const double times = gap.rms.at("segment") / gap.noise_std; times > kMuchLeft)
      left += fmt::format("{}{} {:.3g} times its noise", left.empty() ? "" : ", ", gap.channel, times);
  return left;
}

// Noise hides a gap.
void remark_noise(const Datasheet& sheet, GapResult& result) {
  for (const ChannelGap& gap : result.gap[1].channels) {
    const Channel& channel = sheet.channels[static_cast<std::size_t>(sheet.channel(gap.channel))];
    if (channel.noise_std > 0 && gap.noise_std > kMuchNoise * std::max(channel.noise_std, channel.resolution))
      result.remarks.push_back(
          fmt::format("{}: its noise is {:.2g} times the datasheet's; a gap that is smaller is not seen", gap.channel,
                      gap.noise_std / channel.noise_std));
  }
}

// Steps 1 to 5 of the header. `stated`: what the user's datasheet says of the parameters.
GapResult diagnose_all(const Datasheet& sheet, const Datasheet& stated, std::vector<SegmentedRun> runs,
                       std::vector<SegmentedRun> holdout, const GapSettings& settings, const GapProgress& progress) {
  const GapOptions& options = settings.options;
  const GapOptions::Verdict& verdict = options.verdict;
  GapResult result;
  result.rig = sheet.rig;
  for (const SegmentedRun& run : runs) result.runs.push_back(run.name);
  for (const SegmentedRun& run : holdout) result.holdout.push_back(run.name);
  for (const auto* list : {&runs, &holdout})
    for (const SegmentedRun& run : *list)
      if (!run.remark.empty()) result.remarks.push_back(run.remark);
  need_readings(sheet, runs);
  const double segment_s = static_cast<double>(runs.front().segment) * runs.front().period;
  if (std::string text = remark_of_own_start(sheet, segment_s); !text.empty())
    result.remarks.push_back(std::move(text));
  SplitRuns split = split_runs(sheet, std::move(runs), std::move(holdout), options.segments);

  GapTrials work(sheet, std::move(split.runs), split.folds, split.learn, settings, progress);
  const double values = work.held_out_values();
  const double quiet = quiet_excess(work.model());
  if (work.learned_segments() < verdict.few_segments)
    result.remarks.push_back(fmt::format(
        "few data: {:g} segments of {:g} s to learn from; intervals are wider for it, and small effects do not show",
        work.learned_segments(), work.segment_s()));
  work.tell(0.02, "refitting parameters");
  const EffectSearch search = search_effects(work, settings.most_effects, quiet);
  std::string disagree = work.runs_disagree(search.base);
  for (const FreePlace& noise : search.noise)
    result.remarks.push_back(fmt::format("{}: its noise has a memory of {:.2g} s; what depends on nothing is no cause",
                                         sheet.port(noise.port).channel, noise.memory));
  if (std::string text = told_at_bounds(stated, search.base.model, options); !text.empty())
    result.remarks.push_back(std::move(text));
  if (std::string text = told_beyond_range(stated, search.base.effects); !text.empty())
    result.remarks.push_back(std::move(text));
  ModelChange nominal;
  nominal.parameters = sheet.nominal();
  const double nominal_excess = mean_excess(search.nominal, values);
  const double refit_excess = mean_excess(search.plain.held_out, values);
  const double explained_excess = mean_excess(search.losses, values);
  const bool found = !search.base.effects.empty();

  work.tell(0.93, "measuring the gap");
  result.discrepancies.push_back({"refit", search.before});
  if (found) result.discrepancies.push_back({"explained", search.after});
  if (found) result.shrink_refit = shrink_of(mean_excess, search.plain.held_out, search.losses, values);
  result.shrink_nominal = nominal_excess > 0 ? 1 - explained_excess / nominal_excess : 0;
  if (refit_excess > 0)
    result.shrink_interval =
        shrink_interval(mean_excess, search.plain.held_out, search.losses, values, settings.seed, verdict.bootstraps);
  result.ranked = rank_causes(work, search);
  result.places = rank_places(sheet, search.screened, result.ranked, verdict.place_probability);
  if (found) name_effects(search, work.ninety_percent(), verdict, result);

  measure_levels(work.model(), nominal, search.plain.fit.model, search.base, settings.jobs, result);
  GapEvidence& evidence = result.evidence;
  evidence = gap_evidence(search.before, search.after, found);
  evidence.plain = std::all_of(search.base.effects.begin(), search.base.effects.end(),
                               [](const Candidate& candidate) { return restarts_freely(candidate.effect); });
  evidence.shrink = result.shrink_refit;
  evidence.shrink_low = result.shrink_interval.low;
  if (found) {
    evidence.typical_shrink = shrink_of(typical_excess, search.plain.score, search.score, values);
    evidence.typical_shrink_low =
        shrink_interval(typical_excess, search.plain.score, search.score, values, settings.seed, verdict.bootstraps)
            .low;
  }
  evidence.size = gap_size(result.gap[1]);
  evidence.excess = result.gap[1].excess;
  evidence.calibrated = nominal_excess - refit_excess;
  evidence.left = explained_excess;
  evidence.quiet = quiet;
  const std::vector<SizeAgreement> sizes = work.sizes_agree(search.base);
  for (const SizeAgreement& size : sizes) evidence.spread = std::max(evidence.spread, size.spread);
  if (found) evidence.output_shrink = output_shrink(result.gap[1], result.gap[2], search.base.effects, verdict);
  // What is left beside it would be no silence either.
  const bool much_left = found && explained_excess > verdict.silent_excess_variances &&
                         gap_size(result.gap[2]) > verdict.silent_matters_ratio * settings.matters;
  evidence.beyond = std::any_of(search.base.effects.begin(), search.base.effects.end(), [&](const Candidate& effect) {
    return much_left ? !beyond_range(sheet, effect).empty() : at_farthest(sheet, effect, options);
  });
  result.matters = settings.matters;
  const GapVerdict answer = judge_gap(evidence, settings.matters, verdict);
  for (std::size_t e = 0; e < sizes.size() && answer.names; ++e)
    if (const EffectSpec& effect = search.base.effects[e].effect; sizes[e].spread > verdict.size_spread)
      result.remarks.push_back(
          fmt::format("{}@{}: its size is {:.2g} to {:.2g} of that told from part to part of the runs: it makes up for "
                      "something else, or changes",
                      effect.effect, effect.port, sizes[e].least, sizes[e].most));
  result.verdict = answer.verdict;
  result.unknown_probability = 1 / (1 + std::exp(-verdict.doubt_steepness * (answer.doubt - 1)));
  // What runs disagree in may keep a cause from being found that all of them have.
  if (disagree.empty() && result.verdict == "unknown" && !found && !search.ranked.empty()) {
    const GapTrials::Standing standing = work.standing();
    const FitResult& likeliest = search.ranked.front().fit;
    work.stand(likeliest.model);
    disagree = work.runs_disagree(likeliest);
    work.come_back(standing);
  }
  if (!disagree.empty()) result.remarks.push_back(std::move(disagree));
  // Where the likelihood from sample to sample says nothing for effects that close much, that much can be closed.
  result.closable = evidence.effects > 0 ? evidence.effects / (evidence.effects + evidence.free_after)
                                         : std::max(result.shrink_refit, 0.0);
  // Under "unknown" the effects that were accepted stay as a part of the cause, however little they close.
  if (!answer.names && result.verdict != "unknown") {
    result.effects.clear();
    result.equivalent.clear();
    result.shrink_refit = result.closable = 0;
    result.shrink_interval = {};
  }
  const bool nowhere = result.verdict == "unknown" && !answer.placed;
  if (!answer.names && result.verdict == "unknown") result.places = free_places(sheet, search.before, verdict);

  const std::vector<FreePlace>& free = (answer.names ? search.after : search.before).places;
  if (result.verdict == "unknown" && !nowhere && !free.empty() && free.front().gain > 0) {
    work.tell(0.95, "reconstructing what is missing");
    result.missing =
        unknown_shape(work, search, answer.names, answer.names ? explained_excess : refit_excess, result.remarks);
  }

  // Rounding is in the noise, so it is beside all this: a fact of the recording, and under "unknown" a part.
  const std::vector<NamedEffect> rounded = rounded_channels(work.model(), settings.without);
  const bool unknown = result.verdict == "unknown";
  if (!rounded.empty()) {
    if (result.effects.empty() && !unknown) {
      PlaceScore place;
      place.port = rounded.front().port;
      place.component = sheet.port(place.port).component;
      place.kind = "sensor";
      place.share = 1;
      result.places = {place};
    }
    if (!unknown) result.verdict = "named";
    result.effects.insert(result.effects.end(), rounded.begin(), rounded.end());
  }
  result.where_kind = result.verdict == "none" || result.verdict == "miscalibrated" || result.places.empty()
                          ? "none"
                          : result.places.front().kind;

  if (result.verdict == "named" && !result.equivalent.empty()) {
    work.tell(0.95, "looking for a run that separates");
    const NamedEffect& rival = result.equivalent.front();
    const auto is_rival = [&](const FitResult& fit) {
      const EffectSpec& effect = fit.effects.back().effect;
      return effect.effect == rival.effect && effect.port == rival.port;
    };
    // Two of the first round as they stand alone, those of a later one beside all others.
    const FitResult *one = &search.ranked.front().fit, *other = &search.base;
    for (const Structure& s : search.ranked)
      if (is_rival(s.fit)) other = &s.fit;
    if (other == &search.base)
      for (const Rival& r : search.rivals)
        if (is_rival(r.fit)) one = &search.base, other = &r.fit;
    result.next =
        separating_runs(sheet, one->model, other->model, rival.instead_of + " and " + rival.effect + "@" + rival.port,
                        options, settings.jobs, result.remarks);
  }
  const bool no_cause = !answer.names && result.verdict != "unknown";
  if (no_cause) remark_noise(sheet, result);
  const bool beside = result.verdict == "named" && gap_size(result.gap[2]) > settings.matters;
  describe(sheet, result,
           beside                ? what_is_left(result.gap[2])
           : no_cause || nowhere ? what_is_left(result.gap[1])
                                 : "");
  return result;
}

// Step 6: a cause that is found where the parameters stay nearer to the datasheet; nothing where none is.
std::optional<GapResult> diagnose_nearer(const Datasheet& sheet, const std::vector<SegmentedRun>& runs,
                                         const std::vector<SegmentedRun>& holdout, const GapSettings& nearer,
                                         const GapProgress& progress, const std::vector<std::string>& at_bounds,
                                         double bound_tolerances) {
  GapResult result = diagnose_all(sheet, sheet, runs, holdout, nearer, progress);
  if (result.verdict != "named") return std::nullopt;
  result.remarks.push_back(
      fmt::format("a refit without a cause explains the runs only with {} {:.2g} tolerances from the datasheet at once",
                  fmt::join(at_bounds, ", "), bound_tolerances));
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
  GapResult result = diagnose_all(sheet, sheet, found.runs, found.holdout, settings, progress);
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

// A time from which a signal is stuck, in a run that began `later` s before the one it was found in.
void shift_stuck(NamedEffect& effect, double later) {
  if (effect.family != "stuck") return;
  effect.parameters.at("from") += later;
  if (const auto interval = effect.intervals.find("from"); interval != effect.intervals.end())
    interval->second = {interval->second.low + later, interval->second.high + later};
}

// Whether some runs have it, from their beginning on, and others not.
bool between_runs(const Onset& onset) { return onset.moments.front().time == 0; }

// Moments in words; where there are none, names of the runs.
std::string told(const Onset& onset, const std::vector<SegmentedRun>& runs) {
  std::string text;
  for (const auto& [run, time] : onset.moments)
    text += fmt::format("{}{}{}", text.empty() ? "" : " and ",
                        between_runs(onset) ? "" : fmt::format("{:.4g} s of ", time), runs[run].name);
  return text;
}

// A transducer that is stuck tells since when by its readings: the model may not leave them at once.
void date_by_readings(const Datasheet& sheet, const std::vector<SegmentedRun>& runs, const NamedEffect& stuck,
                      Onset& onset) {
  if (stuck.effect != "stuck" || port_kind(stuck.port) != PortKind::sensor) return;
  const auto channel = static_cast<std::size_t>(sheet.channel(sheet.port(stuck.port).channel));
  const Channel& of = sheet.channels[channel];
  for (Since::Moment& moment : onset.moments)
    moment.time = std::min(moment.time, still_since({runs[moment.run]}, channel, of.resolution, noise_of(of)));
}

// Step 8. Nothing where no cause that began is told; `remark` says when something began all the same.
std::optional<GapResult> diagnose_since(const Datasheet& sheet, const std::vector<SegmentedRun>& runs,
                                        const std::vector<SegmentedRun>& holdout, const GapSettings& settings,
                                        const GapProgress& progress, std::string& remark) {
  std::vector<SegmentedRun> all = runs;
  all.insert(all.end(), holdout.begin(), holdout.end());
  OnsetSearch search(sheet, all, settings.options, settings.jobs);
  const std::optional<Onset> onset = search.find();
  if (!onset) return std::nullopt;
  const std::string moments = told(*onset, all);
  remark = between_runs(*onset)
               ? "the model, calibrated on the other recordings, explains those and not " + moments
               : "until " + moments + " the model, calibrated there, explains what was recorded, and then no more";
  std::vector<SegmentedRun> rest, rest_held_out;
  std::vector<std::size_t> of;  // which run each is a rest of
  for (std::size_t r = 0; r < all.size(); ++r) {
    const std::size_t first = onset->segments[r];
    if (first == all[r].segments()) continue;
    (r < runs.size() ? rest : rest_held_out)
        .push_back(first == 0 ? all[r] : rest_of(sheet, all[r], first, settings.options.segments));
    of.push_back(r);
  }
  if (rest.empty()) return std::nullopt;
  const bool between = between_runs(*onset);
  const Datasheet rig = between ? sheet : calibrated(sheet, *onset, settings.options.onset.tolerance_fraction);
  GapSettings asked = settings;
  // What began then is more than what it closes; the parameters, which hardly move, leave a gap of their own.
  if (!between) asked.options.verdict.named_shrink_fraction = 0;
  GapResult result = diagnose_all(rig, sheet, std::move(rest), std::move(rest_held_out), asked, progress);
  if (result.verdict != "named") return std::nullopt;
  std::vector<EffectSpec> effects;
  for (const NamedEffect& named : result.effects) {
    EffectSpec effect{named.effect, named.port, {}};
    for (const auto& parameter : find_effect_type(named.effect)->parameters)
      effect.parameters.push_back(named.parameters.at(parameter.name));
    effects.push_back(std::move(effect));
  }
  if (search.contradicted(*onset, effects) < settings.options.onset.contradicted_fraction) return std::nullopt;
  // Factors on what the user's datasheet says.
  for (GapLevel& level : result.gap)
    for (std::size_t i = 0; i < sheet.parameters.size(); ++i) {
      const Parameter& p = sheet.parameters[i];
      if (between || onset->parameters[i] == p.nominal) continue;
      const auto factor = level.parameters.emplace(p.name, 1.0).first;
      factor->second *= onset->parameters[i] / p.nominal;
    }
  Onset dated = *onset;
  if (!between)
    for (const NamedEffect& named : result.effects) date_by_readings(sheet, all, named, dated);
  const SegmentedRun& run = all.front();
  result.since = Since{dated.moments, static_cast<double>(run.segment) * run.period};
  result.sentence +=
      between ? fmt::format(" It is in {}; the model explains what else was recorded without it.", told(dated, all))
              : fmt::format(" Since {} (to {:.2g} s); until then the model explains the recording{}.", told(dated, all),
                            result.since->within, all.size() > 1 ? "s" : "");
  // Positions and times are those of the runs as they were given; of several moments a time is the first one's.
  for (std::vector<NamedEffect>* named : {&result.effects, &result.equivalent})
    for (NamedEffect& effect : *named) shift_stuck(effect, dated.moments.front().time);
  for (RankedCause& cause : result.ranked) shift_stuck(cause.effect, dated.moments.front().time);
  std::size_t& shown = result.series.run;
  shown = of[shown];
  for (double& time : result.series.time) time += onset->begins(shown);
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
  GapResult result = diagnose_all(sheet, sheet, runs, holdout, used, forward);
  if (result.verdict == "none" || result.verdict == "miscalibrated") {
    const GapOptions& options = settings.options;
    const std::vector<std::string> far = at_bounds(sheet, result, options);
    if (far.size() >= options.nearer.at_bounds) {
      if (forward) forward(kFirstShare, "asking again with parameters nearer to the datasheet");
      used.options.linearisation.parameter_bound_tolerances = options.nearer.bound_tolerances;
      std::optional<GapResult> nearer =
          diagnose_nearer(sheet, runs, holdout, used, again, far, options.linearisation.parameter_bound_tolerances);
      if (nearer)
        result = std::move(*nearer);
      else
        used = settings;
    }
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
    if (std::optional<GapResult> since = diagnose_since(sheet, runs, holdout, used, again, remark)) {
      since->runs = std::move(result.runs);
      since->holdout = std::move(result.holdout);
      result = std::move(*since);
    } else if (result.verdict == "unknown" && !remark.empty()) {
      result.remarks.push_back(remark);
    }
  }
  if (away && std::none_of(result.effects.begin(), result.effects.end(),
                           [&](const NamedEffect& e) { return e.port == away->port; }))
    result.remarks.push_back(told(sheet, *away) + ": its transducer drifts, or that of the rate is offset");
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return result;
}

}  // namespace faultline

#include "faultline/gap/diagnose_runs.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "faultline/gap/effect_search.h"
#include "faultline/gap/measure.h"
#include "faultline/gap/next_run.h"
#include "faultline/gap/ranked_causes.h"
#include "faultline/gap/rounded_channels.h"
#include "faultline/gap/shrink.h"
#include "faultline/gap/split_runs.h"
#include "faultline/gap/told_bounds.h"
#include "faultline/gap/unknown_shape.h"
#include "faultline/gap/verdict.h"
#include "faultline/segments/own_start.h"

namespace faultline {
namespace {

constexpr double kMuchLeft = 1.5;  // times the noise
constexpr double kMuchNoise = 10;  // times the datasheet's

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

}  // namespace

GapResult diagnose_runs(const Datasheet& sheet, const Datasheet& stated, std::vector<SegmentedRun> runs,
                        std::vector<SegmentedRun> holdout, const GapSettings& settings, const GapProgress& progress,
                        Wanted wanted) {
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
    return much_left ? beyond_range(sheet, effect) : at_farthest(sheet, effect, options);
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
  if (wanted == Wanted::name && result.verdict == "unknown") return result;
  std::string disagree = work.runs_disagree(search.base);
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

}  // namespace faultline

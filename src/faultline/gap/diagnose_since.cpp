#include "faultline/gap/diagnose_since.h"

#include <algorithm>

#include <fmt/format.h>

#include "faultline/gap/diagnose_runs.h"
#include "faultline/gap/onset.h"
#include "faultline/gap/stuck_times.h"

namespace faultline {
namespace {

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

std::vector<EffectSpec> specs_of(const std::vector<NamedEffect>& effects) {
  std::vector<EffectSpec> result;
  for (const NamedEffect& named : effects) {
    result.push_back({named.effect, named.port, {}});
    for (const auto& parameter : find_effect_type(named.effect)->parameters)
      result.back().parameters.push_back(named.parameters.at(parameter.name));
  }
  return result;
}

}  // namespace

std::optional<GapResult> diagnose_since(const Datasheet& sheet, const std::vector<SegmentedRun>& runs,
                                        const std::vector<SegmentedRun>& holdout, const GapSettings& settings,
                                        const GapProgress& progress, double refit_excess, std::string& remark) {
  std::vector<SegmentedRun> all = runs;
  all.insert(all.end(), holdout.begin(), holdout.end());
  OnsetSearch search(sheet, all, settings.options, settings.jobs);
  const std::optional<Onset> onset = search.find();
  if (!onset || refit_excess < settings.options.onset.explained_fraction * onset->following) return std::nullopt;
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
  const Datasheet rig = between ? sheet : calibrated(sheet, *onset, settings.options.onset);
  GapSettings asked = settings;
  // What began then is more than what it closes; the parameters, which hardly move, leave a gap of their own.
  if (!between) asked.options.verdict.named_shrink_fraction = 0;
  GapResult result =
      diagnose_runs(rig, sheet, std::move(rest), std::move(rest_held_out), asked, progress, Wanted::name);
  if (result.verdict != "named") return std::nullopt;
  if (search.contradicted(*onset, specs_of(result.effects)) < settings.options.onset.contradicted_fraction)
    return std::nullopt;
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

}  // namespace faultline

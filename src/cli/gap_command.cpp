// `faultline gap`: where model and rig part, which effect causes it, and how far the gap shrinks once that effect is
// added. The JSON form is a contract: docs/gap.schema.json.
#include <algorithm>
#include <cmath>
#include <iterator>
#include <memory>
#include <mutex>

#include <unistd.h>

#include <fmt/format.h>

#include "cli/adopt.h"
#include "cli/gap_report.h"
#include "cli/json_text.h"
#include "cli/load_recording.h"
#include "cli/options.h"
#include "cli/output_file.h"
#include "cli/subcommand.h"
#include "faultline/gap/averaging.h"
#include "faultline/gap/diagnose_gap.h"
#include "faultline/numerics/usable_cores.h"
#include "faultline/rig/effect_unit.h"
#include "faultline/segments/averaged_rows.h"
#include "faultline/segments/even_rows.h"
#include "faultline/segments/segment_length.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

using Json = nlohmann::ordered_json;

struct Options {
  std::vector<std::string> runs, holdout, without;
  std::string rig, config, json, series, report, adopt;
  int jobs = 0;
  std::uint64_t seed = 1;
  double matters = GapSettings().matters;
};

Json interval_json(const Interval& interval) { return Json::array({interval.low, interval.high}); }

Json effect_json(const Datasheet& sheet, const NamedEffect& e) {
  Json parameters = Json::object(), units = Json::object(), intervals = Json::object();
  for (const auto& [name, value] : e.parameters) parameters[name] = value;
  const EffectType& type = *find_effect_type(e.effect);
  for (const EffectParameter& p : type.parameters) units[p.name] = parameter_unit(sheet, sheet.port(e.port), type, p);
  for (const auto& [name, interval] : e.intervals) intervals[name] = interval_json(interval);
  return {{"effect", e.effect}, {"port", e.port},         {"family", e.family},       {"parameters", parameters},
          {"units", units},     {"intervals", intervals}, {"at_bounds", e.at_bounds}, {"probability", e.probability}};
}

Json curve_json(const std::string& port, const std::optional<SignalCurve>& curve) {
  if (!curve) return Json();
  Json json = {{"variable", curve->variable},
               {"unit", curve->unit},
               {"at", curve->at},
               {"value", curve->value},
               {"standard_error", curve->standard_error},
               {"score", curve->score},
               {"effect", Json()}};
  if (curve->passes >= 0) json["effect"] = to_string(curve_effect(port, *curve));
  return json;
}

Json missing_json(const Datasheet& sheet, const std::optional<MissingSignal>& missing) {
  if (!missing) return Json();
  Json factors = Json::object();
  for (const auto& [name, factor] : factors_beside(sheet, *missing)) factors[name] = factor;
  const SignalCourse& course = missing->course;
  return {{"port", missing->port},
          {"unit", missing->unit},
          {"beside", missing->beside},
          {"size", missing->size},
          {"memory", missing->memory},
          {"readings", missing->readings},
          {"formula", missing->formula},
          {"score", missing->score},
          {"curve", curve_json(missing->port, missing->curve)},
          {"adoptable", curve_json(missing->port, missing->adoptable)},
          {"adopted_shrink", missing->adopted_shrink},
          {"parameter_factors", factors},
          {"points", {{"at", missing->points.at}, {"value", missing->points.value}}},
          {"course",
           {{"run", course.run},
            {"time", course.time},
            {"value", course.value},
            {"standard_error", course.standard_error},
            {"formula", course.formula}}}};
}

Json regions_json(const std::vector<Region>& regions) {
  Json list = Json::array();
  for (const Region& r : regions)
    list.push_back({{"name", r.name},
                    {"enrichment", r.enrichment},
                    {"share", r.share},
                    {"refit", r.refit},
                    {"explained", r.explained}});
  return list;
}

Json since_json(const GapResult& result) {
  if (!result.since) return Json();
  Json moments = Json::array();
  for (const auto& [run, time] : result.since->moments) {
    const std::size_t learnt = result.runs.size();
    moments.push_back({{"run", run < learnt ? result.runs[run] : result.holdout[run - learnt]}, {"time", time}});
  }
  Json since = moments.front();
  since["within"] = result.since->within;
  since["moments"] = moments;
  return since;
}

Json result_json(const Datasheet& sheet, const GapResult& result) {
  Json json = {
      {"rig", result.rig}, {"runs", result.runs}, {"holdout", result.holdout}, {"deciding_run", result.deciding_run}};
  for (const GapLevel& level : result.gap) {
    Json channels = Json::object();
    for (const ChannelGap& c : level.channels) {
      Json entry = {{"unit", c.unit}, {"noise_floor", c.noise_std}, {"excess", c.excess}};
      for (const auto& [horizon, value] : c.rms) entry["rms"][horizon] = value;
      for (const auto& [horizon, value] : c.nrmse) entry["nrmse"][horizon] = value;
      for (const auto& [horizon, value] : c.fit) entry["fit"][horizon] = value;
      channels[c.channel] = entry;
    }
    Json parameters = Json::object();
    for (const auto& [name, factor] : level.parameters) parameters[name] = factor;
    json["gap"][level.name] = {{"excess", level.excess}, {"parameter_factors", parameters}, {"channels", channels}};
  }
  Json ranked = Json::array();
  for (const PlaceScore& place : result.places)
    ranked.push_back({{"port", place.port},
                      {"component", place.component},
                      {"kind", place.kind},
                      {"score", place.score},
                      {"share", place.share},
                      {"inseparable", place.inseparable}});
  json["where"] = {{"kind", result.where_kind},
                   {"ranked", ranked},
                   {"regions", regions_json(result.regions)},
                   {"bands", regions_json(result.bands)}};
  Json effects = Json::array(), equivalent = Json::array(), causes = Json::array();
  for (const NamedEffect& e : result.effects) effects.push_back(effect_json(sheet, e));
  for (const NamedEffect& e : result.equivalent) {
    equivalent.push_back(effect_json(sheet, e));
    equivalent.back()["instead_of"] = e.instead_of;
  }
  for (const RankedCause& cause : result.ranked) {
    Json entry = effect_json(sheet, cause.effect);
    entry["gain"] = cause.gain;
    entry["followed"] = cause.followed;
    entry["behind"] = cause.behind;
    entry["standard_error"] = cause.standard_error;
    causes.push_back(entry);
  }
  json["cause"] = {{"verdict", result.verdict},
                   {"unknown_probability", result.unknown_probability},
                   {"sentence", result.sentence},
                   {"effects", effects},
                   {"since", since_json(result)},
                   {"equivalent", equivalent},
                   {"why_equivalent", result.why_equivalent},
                   {"ranked", causes}};
  json["discrepancy"] = Json::array();
  for (const LevelDiscrepancy& level : result.discrepancies) {
    Json places = Json::array(), noise = Json::object();
    for (const FreePlace& place : level.discrepancy.places)
      places.push_back({{"port", place.port}, {"gain", place.gain}, {"level", place.level}, {"memory", place.memory}});
    for (std::size_t s = 0; s < sheet.states.size(); ++s) noise[sheet.states[s].name] = level.discrepancy.noise[s];
    json["discrepancy"].push_back(
        {{"level", level.name}, {"evidence", level.discrepancy.loss}, {"noise", noise}, {"places", places}});
  }
  const GapEvidence& evidence = result.evidence;
  json["evidence"] = {{"found", evidence.found},
                      {"plain", evidence.plain},
                      {"shrink", evidence.shrink},
                      {"shrink_low", evidence.shrink_low},
                      {"typical_shrink", evidence.typical_shrink},
                      {"typical_shrink_low", evidence.typical_shrink_low},
                      {"output_shrink", evidence.output_shrink},
                      {"perfect", evidence.perfect},
                      {"effects", evidence.effects},
                      {"free_before", evidence.free_before},
                      {"free_after", evidence.free_after},
                      {"readings", evidence.readings},
                      {"size", evidence.size},
                      {"matters", result.matters},
                      {"excess", evidence.excess},
                      {"calibrated", evidence.calibrated},
                      {"left", evidence.left},
                      {"quiet", evidence.quiet},
                      {"spread", evidence.spread},
                      {"beyond", evidence.beyond}};
  json["missing"] = missing_json(sheet, result.missing);
  json["shrink"] = {{"heldout", result.shrink_refit},
                    {"against_nominal", result.shrink_nominal},
                    {"interval", interval_json(result.shrink_interval)},
                    {"closable", result.closable}};
  Json next = Json::array();
  for (const NextRun& run : result.next)
    next.push_back(
        {{"excitation", run.excitation}, {"duration", run.duration}, {"gain", run.gain}, {"between", run.between}});
  json["next"] = next;
  json["remarks"] = result.remarks;
  json["seconds"] = result.seconds;
  return json;
}

std::string series_csv(const GapSeries& series) {
  std::string text = "t,run";
  for (const std::string& name : series.channels)
    text += fmt::format(",y:{0},nominal:{0},refit:{0},explained:{0}", name);
  const std::size_t width = 4 * series.channels.size();
  for (std::size_t k = 0; k < series.time.size(); ++k) {
    fmt::format_to(std::back_inserter(text), "\n{:.6f},{}", series.time[k], series.run);
    for (std::size_t i = 0; i < width; ++i)
      fmt::format_to(std::back_inserter(text), ",{:.7g}", series.values[k * width + i]);
  }
  return text + "\n";
}

// As it could be typed again; words with spaces in quotes.
std::string command_text(const Options& options) {
  std::string text = "faultline gap";
  const auto add_word = [&](const std::string& word) {
    text += word.find_first_of(" \t'\"$") == std::string::npos ? " " + word : " \"" + word + "\"";
  };
  const auto add_option = [&](const char* name, const std::string& value) {
    if (value.empty()) return;
    add_word(name);
    add_word(value);
  };
  for (const std::string& run : options.runs) add_word(run);
  for (const std::string& run : options.holdout) add_option("--holdout", run);
  add_option("--rig", options.rig);
  add_option("--config", options.config);
  for (const std::string& effect : options.without) add_option("--without", effect);
  add_option("--seed", std::to_string(options.seed));
  if (options.matters != GapSettings().matters) add_option("--matters", fmt::format("{:g}", options.matters));
  return text;
}

bool is_at_bound(const NamedEffect& effect, const std::string& parameter) {
  return std::find(effect.at_bounds.begin(), effect.at_bounds.end(), parameter) != effect.at_bounds.end();
}

void print_missing(const MissingSignal& missing) {
  fmt::print("\nmissing at {}{}: a signal of {:.3g} {}", missing.port,
             missing.beside == "explained" ? ", beside what is found" : "", missing.size, missing.unit);
  if (missing.formula.empty() && missing.curve && missing.curve->score > missing.score)
    fmt::print("; no short formula explains it (score {:.2f}), a curve over {} does better (score {:.2f})\n",
               missing.score, missing.curve->variable, missing.curve->score);
  else if (missing.formula.empty())
    fmt::print("; no short formula of the model's variables explains it (score {:.2f})\n", missing.score);
  else
    fmt::print(", {} (score {:.2f} on held-out runs, {:.0f} readings)\n", missing.formula, missing.score,
               missing.readings);
  if (missing.adoptable)
    fmt::print("as a curve over {} it closes {:.0f} % of what is left; --adopt takes it\n", missing.adoptable->variable,
               100 * missing.adopted_shrink);
}

std::string where(const GapResult& result) {
  if (result.places.empty()) return "at no single place";
  const PlaceScore& first = result.places.front();
  std::string text = fmt::format("{} ({})", first.port, first.component);
  for (const std::string& other : first.inseparable) text += ", or " + other;
  return text;
}

std::string with_sizes(const NamedEffect& effect) {
  std::string text = effect.effect + "@" + effect.port + ":";
  const char* separator = "";
  for (const auto& [name, value] : effect.parameters) {
    text += fmt::format("{}{}={:.4g}{}", separator, name, value, is_at_bound(effect, name) ? " (at its bound)" : "");
    separator = ",";
  }
  return text;
}

void print_result(const GapResult& result) {
  fmt::print("{}: {}\n{}\n", result.rig, result.verdict, result.sentence);
  fmt::print("\n{:<22} {:>12} {:>12} {:>12} {:>12} {:>12}\n", "rms over a segment", "noise", "nominal", "refit",
             "explained", "free run");
  for (std::size_t c = 0; c < result.gap.front().channels.size(); ++c) {
    const ChannelGap& gap = result.gap[0].channels[c];
    const ChannelGap& explained = result.gap[2].channels[c];
    fmt::print("{:<22} {:>12.4g} {:>12.4g} {:>12.4g} {:>12.4g} {:>12.4g} {}\n", gap.channel, gap.noise_std,
               gap.rms.at("segment"), result.gap[1].channels[c].rms.at("segment"), explained.rms.at("segment"),
               explained.rms.at("free"), gap.unit);
  }
  if (result.verdict == "named" || result.verdict == "unknown") {
    fmt::print("\nwhere: {}\n", where(result));
    for (const Region& region : result.regions)
      fmt::print("  {:.1f} times the mean where {}\n", region.enrichment, region.name);
    fmt::print("\n{:>6} {:>10}  cause{}\n", "p", "gain",
               result.verdict == "unknown" ? " (p: among the effects of the library)" : "");
    for (std::size_t i = 0; i < std::min<std::size_t>(result.ranked.size(), 5); ++i) {
      const RankedCause& cause = result.ranked[i];
      fmt::print("{:>6.2f} {:>10}  {}\n", cause.effect.probability,
                 fmt::format("{}{:.0f}", cause.followed ? "" : "< ", cause.gain), with_sizes(cause.effect));
    }
    // Sizes beside each other, where those above are each one's alone.
    if (result.effects.size() > 1) {
      fmt::print("\ntogether:\n");
      for (const NamedEffect& effect : result.effects) fmt::print("  {}\n", with_sizes(effect));
    }
    if (!result.equivalent.empty()) fmt::print("\nnot told apart on these runs:\n");
    for (const NamedEffect& effect : result.equivalent)
      fmt::print("  {}, instead of {}\n", with_sizes(effect), effect.instead_of);
    if (!result.effects.empty())
      fmt::print("\nshrink on held-out data: {:.0f} % (90 %: {:.0f} to {:.0f}), against nominal {:.0f} %\n",
                 100 * result.shrink_refit, 100 * result.shrink_interval.low, 100 * result.shrink_interval.high,
                 100 * result.shrink_nominal);
    if (result.missing) print_missing(*result.missing);
  }
  for (const NextRun& run : result.next)
    fmt::print("next: record {} for {:g} s; it tells {} apart (predicted log likelihood {:.0f})\n", run.excitation,
               run.duration, run.between, run.gain);
  for (const std::string& remark : result.remarks) fmt::print("{}\n", remark);
}

void run(const Options& options) {
  std::vector<LoadedRecording> runs, holdout;
  Datasheet sheet;
  bool have_sheet = false;
  if (!options.report.empty()) check_gap_report();  // now, not after the diagnosis
  const auto load = [&](const std::vector<std::string>& files, std::vector<LoadedRecording>& list) {
    for (const std::string& file : files) {
      LoadedRecording loaded = load_recording(file, options.rig, options.config, Period::of_run);
      keep_own_samples(file, loaded);
      if (have_sheet && loaded.sheet.rig != sheet.rig)
        throw InputError(fmt::format("{}: is of {}, the runs before it of {}; give runs of one rig", file,
                                     loaded.sheet.rig, sheet.rig));
      sheet = loaded.sheet;
      have_sheet = true;
      print_remarks("gap", loaded.remarks);
      list.push_back(std::move(loaded));
    }
  };
  load(options.runs, runs);
  load(options.holdout, holdout);
  for (const std::string& text : options.without) {
    const std::string effect = text.substr(0, text.find('@'));
    if (!find_effect_type(effect))
      throw InputError(fmt::format("--without {}: there is no effect '{}'; `faultline rigs {}` lists them", text,
                                   effect, sheet.rig));
    if (effect.size() < text.size()) sheet.port(text.substr(effect.size() + 1));
  }

  GapSettings settings;
  settings.without = options.without;
  settings.jobs = options.jobs > 0 ? options.jobs : usable_cores();
  settings.seed = options.seed;
  settings.matters = options.matters;
  std::vector<const Recording*> recordings;
  for (const auto* list : {&runs, &holdout})
    for (const LoadedRecording& run : *list) recordings.push_back(&run.recording);
  const double segment = segment_length(sheet, recordings);
  const std::size_t averaged = rows_to_average(sheet, recordings);
  settings.options = for_averages(settings.options, averaged);
  const auto cut = [&](const std::vector<std::string>& files, std::vector<LoadedRecording>& list) {
    std::vector<SegmentedRun> result;
    for (std::size_t i = 0; i < list.size(); ++i) {
      Recording& recording = list[i].recording;
      if (averaged > 1) {
        const double period = fitted_period(sheet, recording);
        recording = averaged_rows(sheet, std::move(recording), period, averaged);
      }
      result.push_back(cut_run(sheet, files[i], std::move(recording), segment));
    }
    return result;
  };
  std::vector<SegmentedRun> learned = cut(options.runs, runs), held_out = cut(options.holdout, holdout);
  const bool show = isatty(STDERR_FILENO) != 0;
  std::mutex guard;
  int shown = -1;
  GapResult result = diagnose_gap(sheet, std::move(learned), std::move(held_out), settings,
                                  [&](double share, const std::string& text) {
                                    const std::lock_guard<std::mutex> lock(guard);
                                    const int percent = static_cast<int>(100 * share);
                                    if (!show || percent == shown) return;
                                    shown = percent;
                                    std::fputs(fmt::format("\r{:>3} % {:<28}", percent, text).c_str(), stderr);
                                  });
  if (show) std::fputs(fmt::format("\r{:<40}\r", "").c_str(), stderr);
  if (averaged > 1)
    result.remarks.push_back(fmt::format(
        "means of {} readings are compared, since the rig shows nothing faster; the noise is theirs", averaged));

  const std::string answer = json_text(result_json(sheet, result));
  if (!options.json.empty()) write_text(options.json, answer);
  if (!options.series.empty()) write_text(options.series, series_csv(result.series));
  if (options.json != "-" && options.series != "-") print_result(result);
  if (!options.report.empty()) {
    GapReportInput input{answer, series_csv(result.series), sheet.file, command_text(options), options.runs};
    input.recordings.insert(input.recordings.end(), options.holdout.begin(), options.holdout.end());
    write_gap_report(input, options.report);
    std::fputs(fmt::format("faultline gap: report written to {}\n", options.report).c_str(), stderr);
  }
  if (!options.adopt.empty()) {
    adopt(sheet, result, options.adopt);
    std::fputs(fmt::format("faultline gap: adopted into {}\n", options.adopt).c_str(), stderr);
  }
}

std::function<void()> add(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  add_input(app, "RUN", options->runs, "recordings to learn from: .bag, or .csv with --rig")->required();
  add_input(app, "--holdout", options->holdout, "recordings to score on; without it the runs score each other");
  app.add_option("--rig", options->rig, "the rig; needed for a .csv");
  add_input(app, "--config", options->config, "a datasheet to read instead of the rig's own");
  app.add_option("--without", options->without, "leave out EFFECT or EFFECT@PORT");
  app.add_option("--jobs", options->jobs, "threads; all cores without it")->check(whole_number(1, 256));
  app.add_option("--seed", options->seed, "of the bootstrap")->check(whole_number(0, UINT64_MAX));
  app.add_option(
         "--matters", options->matters,
         "gap beyond the noise, as a fraction of what the channels move, from which it must have a cause; below a "
         "tenth of it none is named")
      ->check(number_between(0, 10));
  add_text_output(app, "--json", options->json, "write the answer as JSON to this file; - is standard output");
  add_text_output(app, "--series", options->series,
                  "write the deciding run as CSV, measured and as the three levels have it; - is standard output");
  add_output(app, "--report", options->report, "write the answer as one HTML file that needs nothing else");
  add_output(app, "--adopt", options->adopt,
             "write a datasheet with the refitted parameters and what was found to this file");
  return [options] { run(*options); };
}

FAULTLINE_SUBCOMMAND(gap,
                     {"gap", "say where model and rig part, which effect causes it, how far adding it closes the gap",
                      "faultline gap run1.bag run2.bag --json gap.json", add});

}  // namespace
}  // namespace faultline

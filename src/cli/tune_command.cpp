// `faultline tune`: from recordings of a healthy rig, the noise covariances of an estimator stage, the thresholds of
// its detectors for a stated rate of false alarms, and what each setting costs in delay (on simulated faults of the
// datasheet).
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include <fmt/format.h>

#include "cli/datasheet_text.h"
#include "cli/json_text.h"
#include "cli/load_recording.h"
#include "cli/options.h"
#include "cli/output_file.h"
#include "cli/subcommand.h"
#include "cli/time_limit.h"
#include "faultline/estimators/process_model.h"
#include "faultline/rig/default_sheet.h"
#include "faultline/signal/error.h"
#include "faultline/tuning/noise_tuning.h"
#include "faultline/tuning/threshold_tuning.h"

namespace faultline {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kAfterOnset = 3e4;  // sample periods of a faulty run after the fault begins
// Blocks without --block: ten seconds, fewer of a rig above 1 kHz (sample periods), longer of a slow one; five times
// what detectors average over, where these are filled in.
constexpr double kBlock = 10, kMostPerBlock = 1e4, kLeastPerBlock = 100, kAveragesPerBlock = 5;
const std::vector<double> kFactors = {0.01, 0.1, 0.3, 1, 3, 10, 100};  // on the entry of Q
const std::vector<double> kRates = {1, 0.1, 0.01};                     // false alarms per hour, besides the wanted one

struct Options {
  std::string rig, config, json, patch, stage, fault, detector, profile;
  std::vector<std::string> healthy;
  double rate = 0.01, block = 0, minutes = 0;
  int faulty_runs = 3;
  bool keep_noise = false;
};

struct Answer {
  NoiseTuning noise;
  std::vector<Threshold> thresholds;
  std::string state, detector, fault;
  std::vector<TradeOff> trade;
};

Json finite(double value) { return std::isfinite(value) ? Json(value) : Json(); }

const StageSpec& stage_of(const Datasheet& sheet, const std::string& name) {
  std::string known;
  for (const StageSpec& stage : sheet.estimators) {
    if (stage.name == name || name.empty()) return stage;
    known += (known.empty() ? "" : ", ") + stage.name;
  }
  throw InputError(
      fmt::format("{}: there is no estimator '{}'; there are {}", sheet.file, name, known.empty() ? "none" : known));
}

// The earliest moment at which a fault of the datasheet changes anything.
double onset_of(const Fault& fault) {
  double onset = kInfinity;
  for (const std::string& text : fault.effects) onset = std::min(onset, parse_effect(text).from);
  for (const CommandTable& table : fault.commands)
    for (std::size_t k = 0; k + 1 < table.time.size(); ++k)
      if (table.value[k + 1] != table.value[k]) {
        onset = std::min(onset, table.time[k]);
        break;
      }
  return onset;
}

std::vector<FaultyRun> faulty_runs(const Datasheet& sheet, const Fault& fault, const Options& options) {
  std::vector<FaultyRun> runs;
  const double onset = onset_of(fault);
  for (int k = 0; k < options.faulty_runs; ++k) {
    SimulationSetup setup;
    setup.profile = !options.profile.empty() ? options.profile : fault.profile;
    setup.seed = static_cast<std::uint64_t>(9001 + k);
    setup.parameters = draw_parameters(sheet, setup.seed);
    for (const std::string& text : sheet.nuisance) setup.effects.push_back(parse_effect(text));
    for (const std::string& text : fault.effects) setup.effects.push_back(parse_effect(text));
    setup.commands = fault.commands;
    runs.push_back({simulate(sheet, setup, onset + kAfterOnset * sheet.sample_period), onset});
  }
  return runs;
}

Json quality_json(const std::vector<InnovationQuality>& rows) {
  Json list = Json::array();
  for (const InnovationQuality& row : rows)
    list.push_back({{"channel", row.name}, {"consistency", row.consistency}, {"whiteness", row.whiteness}});
  return list;
}

Json answer_json(const Datasheet& sheet, const StageSpec& stage, const Options& options, const Answer& a) {
  Json json = {{"rig", sheet.rig}, {"stage", stage.name}, {"runs", options.healthy}};
  json["noise"] = {{"process_noise", a.noise.process_noise},
                   {"measurement_noise", a.noise.measurement_noise},
                   {"finished", a.noise.finished},
                   {"log_likelihood", {{"before", a.noise.likelihood_before}, {"after", a.noise.likelihood_after}}},
                   {"innovations", {{"before", quality_json(a.noise.before)}, {"after", quality_json(a.noise.after)}}}};
  json["false_alarms_per_hour"] = options.rate;
  json["thresholds"] = Json::array();
  for (const Threshold& t : a.thresholds)
    json["thresholds"].push_back({{"detector", t.detector},
                                  {"setting", t.setting},
                                  {"datasheet", t.offset + t.set},
                                  {"chosen", t.offset + t.chosen},
                                  {"upper", t.offset + t.upper},
                                  {"false_alarms_per_hour_as_set", t.rate_as_set},
                                  {"blocks", t.blocks}});
  json["trade_off"] = {{"state", a.state}, {"detector", a.detector}, {"fault", a.fault}, {"settings", Json::array()}};
  for (const TradeOff& t : a.trade) {
    Json delays = Json::array();
    for (const double delay : t.delays) delays.push_back(finite(delay));
    json["trade_off"]["settings"].push_back({{"process_noise", t.value},
                                             {"false_alarms_per_hour", t.rate},
                                             {"threshold", t.threshold},
                                             {"delays", delays}});
  }
  return json;
}

std::string list_text(const std::vector<double>& values) {
  std::string text;
  for (const double value : values) text += (text.empty() ? "" : ", ") + fmt::format("{:.3e}", value);
  return "[" + text + "]";
}

void print_answer(const StageSpec& stage, const Options& options, const Answer& a) {
  if (!options.keep_noise) {
    fmt::print("stage {}: log-likelihood per sample {:.3f} as set, {:.3f} as chosen\n", stage.name,
               a.noise.likelihood_before, a.noise.likelihood_after);
    fmt::print("  process_noise: {}\n  measurement_noise: {}\n\n", list_text(a.noise.process_noise),
               list_text(a.noise.measurement_noise));
    fmt::print("{:<26} {:>23} {:>23}\n{:<26} {:>11} {:>11} {:>11} {:>11}\n", "innovation", "mean square (1)",
               "correlation (0)", "", "as set", "chosen", "as set", "chosen");
    for (std::size_t i = 0; i < a.noise.before.size(); ++i)
      fmt::print("{:<26} {:>11.3g} {:>11.3g} {:>11.2f} {:>11.2f}\n", a.noise.before[i].name,
                 a.noise.before[i].consistency, a.noise.after[i].consistency, a.noise.before[i].whiteness,
                 a.noise.after[i].whiteness);
    fmt::print("\n");
  }
  fmt::print("{:<22} {:<10} {:>11} {:>12} {:>11} {:>11}   for {:g} false alarms per hour\n", "detector", "setting",
             "datasheet", "per hour so", "chosen", "upper", options.rate);
  for (const Threshold& t : a.thresholds)
    fmt::print("{:<22} {:<10} {:>11.3g} {:>12.2g} {:>11.3g} {:>11.3g}   from {} blocks of {:g} s\n", t.detector,
               t.setting, t.offset + t.set, t.rate_as_set, t.offset + t.chosen, t.offset + t.upper, t.blocks,
               options.block);
  if (a.trade.empty()) return;
  fmt::print("\nDelay of {} on {} simulated runs of {}, process noise of {}:\n", a.detector,
             a.trade.front().delays.size(), a.fault, a.state);
  fmt::print("{:>12} {:>16} {:>12}   {}\n", "Q", "alarms per hour", "threshold", "delays, s (- not found)");
  for (const TradeOff& t : a.trade) {
    std::string delays;
    for (const double delay : t.delays) delays += std::isnan(delay) ? "      -" : fmt::format(" {:6.2f}", delay);
    fmt::print("{:>12.3g} {:>16g} {:>12.3g}   {}\n", t.value, t.rate, t.threshold, delays);
  }
}

void write_patch(Datasheet sheet, const StageSpec& stage, const Options& options, const Answer& a) {
  if (!options.keep_noise && sheet.defaulted.count("estimators") > 0) {
    Settings& settings = sheet.estimators[sheet.estimator(stage.name)].settings;
    settings.set("process_noise", a.noise.process_noise);
    settings.set("measurement_noise", a.noise.measurement_noise);
  }
  std::string text = datasheet_text(sheet) + "\n" + defaulted_stages(sheet);
  if (!options.keep_noise) {
    set_stage_setting(sheet, text, stage.name, "process_noise", list_text(a.noise.process_noise));
    set_stage_setting(sheet, text, stage.name, "measurement_noise", list_text(a.noise.measurement_noise));
  }
  for (const Threshold& t : a.thresholds) {
    // Where healthy runs stay below what any alarm needs, no threshold is too low.
    const double chosen = std::max(0.0, t.chosen);
    set_stage_setting(sheet, text, t.detector, t.setting, fmt::format("{:.4e}", t.offset + chosen));
    // What ends an alarm keeps its distance from what begins it.
    const auto detector = std::find_if(sheet.detectors.begin(), sheet.detectors.end(),
                                       [&](const StageSpec& d) { return d.name == t.detector; });
    if (t.setting == "threshold" && detector != sheet.detectors.end() && detector->settings.has("release_threshold")) {
      const double release = detector->settings.number("release_threshold", -1e300, 1e300);
      const double before = detector->settings.number("threshold", -1e300, 1e300);
      set_stage_setting(sheet, text, t.detector, "release_threshold",
                        fmt::format("{:.4e}", (t.offset + chosen) * release / before));
    }
    if (t.setting == "high")
      set_stage_setting(sheet, text, t.detector, "low", fmt::format("{:.4e}", t.offset - chosen));
  }
  write_datasheet(text, options.patch);
}

// s, without --block.
double block_of(const Datasheet& sheet) {
  double block = std::min(kBlock, kMostPerBlock * sheet.sample_period);
  if (sheet.defaulted.count("detectors") > 0) {  // their averages are the rig's own
    block = 0;
    for (const StageSpec& detector : sheet.detectors)
      if (detector.settings.has("average"))
        block = std::max(block, kAveragesPerBlock * detector.settings.number("average", 0, kInfinity));
  }
  return std::max(block, kLeastPerBlock * sheet.sample_period);
}

void run(Options options) {
  const Datasheet sheet = load_datasheet(options.rig, options.config);
  if (options.block <= 0) options.block = block_of(sheet);
  StageSpec stage = stage_of(sheet, options.stage);
  std::vector<Recording> healthy;
  for (const std::string& file : options.healthy) {
    LoadedRecording loaded = load_recording(file, options.rig, options.config);
    print_remarks("tune", loaded.remarks);
    healthy.push_back(std::move(loaded.recording));
  }
  Answer answer;
  if (!options.keep_noise) {
    const bool tell = isatty(STDERR_FILENO) != 0;
    answer.noise = tune_noise(
        sheet, stage, healthy,
        [&](int percent) {
          if (tell) std::fputs(fmt::format("\r{:>3} % of the noise settings ", percent).c_str(), stderr);
        },
        time_limit(options.minutes));
    if (tell) std::fputs("\r\033[K", stderr);
    if (!answer.noise.finished)
      print_remarks("tune", {fmt::format("the search for noise settings was stopped after {:g} minutes, with the best "
                                         "so far",
                                         options.minutes)});
    stage.settings.set("process_noise", answer.noise.process_noise);
    stage.settings.set("measurement_noise", answer.noise.measurement_noise);
  }
  answer.thresholds = tune_thresholds(sheet, stage, healthy, options.rate, options.block);
  if (!options.fault.empty()) {
    answer.fault = options.fault;
    answer.detector = options.detector;
    for (const StageSpec& detector : sheet.detectors)
      if (answer.detector.empty() && detector.settings.word_or("kind", "") == "fault") answer.detector = detector.name;
    const std::vector<bool> walks = random_walks(sheet, stage);
    const auto walk = static_cast<std::size_t>(std::find(walks.begin(), walks.end(), true) - walks.begin());
    if (walk == walks.size())
      throw InputError(
          fmt::format("{}: stage '{}' has no random walk whose noise could be traded", sheet.file, stage.name));
    answer.state = make_process_model(stage.settings.word("model"), sheet, stage.settings)->states()[walk].name;
    std::vector<double> rates = kRates;
    if (std::find(rates.begin(), rates.end(), options.rate) == rates.end()) rates.push_back(options.rate);
    answer.trade = trade_off(sheet, stage, answer.detector, walk, kFactors, rates, healthy,
                             faulty_runs(sheet, sheet.fault(options.fault), options), options.block);
  }
  if (!options.json.empty()) write_text(options.json, json_text(answer_json(sheet, stage, options, answer)));
  if (options.json != "-") print_answer(stage, options, answer);
  if (!options.patch.empty()) write_patch(sheet, stage, options, answer);
}

std::function<void()> add(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  app.add_option("RIG", options->rig, "the rig")->required();
  add_input(app, "HEALTHY", options->healthy,
            "recordings, .bag or .csv, of the healthy rig in the motion it is watched in")
      ->required();
  app.add_option("--stage", options->stage, "the estimator stage; the rig's first without it");
  app.add_option("--rate", options->rate, "false alarms per hour that each threshold is chosen for [0.01]")
      ->check(number_between(1e-6, 1e3));
  app.add_option("--block", options->block,
                 "s, of the blocks whose maxima are taken [10, of 100 to 10000 samples; five averages of detectors "
                 "that are filled in]: longer than a detector's memory")
      ->check(number_between(1e-3, 1e6));
  app.add_option("--fault", options->fault, "a fault of the datasheet: simulated, to show delay against false alarms");
  app.add_option("--detector", options->detector, "whose delay; the first of kind fault without it");
  app.add_option("--profile", options->profile, "of the simulated runs; the fault's own without it");
  app.add_option("--faulty-runs", options->faulty_runs, "how many are simulated [3]")->check(whole_number(1, 100));
  app.add_flag("--keep-noise", options->keep_noise, "leave process_noise and measurement_noise as they are");
  add_minutes(app, options->minutes, "of the search for noise settings, after which the best so far is taken");
  add_input(app, "--config", options->config, "a datasheet to read instead of the rig's own");
  add_text_output(app, "--json", options->json, "write the answer as JSON to this file; - is standard output");
  add_output(app, "--patch", options->patch, "write the datasheet with what was chosen to this file, for --config");
  return [options] { run(*options); };
}

FAULTLINE_SUBCOMMAND(tune, {"tune", "choose a stage's noise settings and thresholds from recordings of a healthy rig",
                            "faultline tune RIG healthy.bag --fault FAULT --rate 0.1", add});

}  // namespace
}  // namespace faultline

// `faultline fit`: the parameters that a rig's datasheet marks, from recordings, with intervals; and what the
// recordings cannot tell.
#include <algorithm>
#include <cmath>
#include <memory>

#include <unistd.h>

#include <fmt/format.h>

#include "cli/datasheet_text.h"
#include "cli/json_text.h"
#include "cli/load_recording.h"
#include "cli/options.h"
#include "cli/output_file.h"
#include "cli/subcommand.h"
#include "cli/time_limit.h"
#include "faultline/fit/parameter_fit.h"
#include "faultline/numerics/quantiles.h"
#include "faultline/numerics/usable_cores.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kWidestTolerance = 0.499;  // from 0.5 on a datasheet refuses it for what must stay above 0

struct Options {
  std::string rig, config, json, patch;
  std::vector<std::string> runs;
  int jobs = 0;
  double minutes = 0;
};

Json result_json(const Datasheet& sheet, const std::vector<std::string>& runs, const ParameterFit& fit) {
  Json json = {{"rig", sheet.rig},           {"runs", runs},
               {"segments", fit.segments},   {"segment_duration", fit.segment_duration},
               {"converged", fit.converged}, {"stopped", fit.stopped},
               {"freedom", fit.freedom},     {"remarks", fit.remarks}};
  json["parameters"] = Json::array();
  for (const FittedParameter& p : fit.parameters)
    json["parameters"].push_back({{"name", p.name},
                                  {"unit", p.unit},
                                  {"nominal", p.nominal},
                                  {"tolerance", p.tolerance},
                                  {"determined", p.determined},
                                  {"at_bound", p.at_bound},
                                  {"estimate", p.estimate},
                                  {"low", p.low},
                                  {"high", p.high},
                                  {"relative_error", {{"statistical", p.statistical}, {"systematic", p.systematic}}},
                                  {"reason", p.reason}});
  json["channels"] = Json::array();
  for (const ChannelMisfit& c : fit.channels)
    json["channels"].push_back({{"channel", c.channel},
                                {"unit", c.unit},
                                {"noise", c.noise},
                                {"before", c.before},
                                {"after", c.after},
                                {"free", c.free}});
  return json;
}

void print_result(const Datasheet& sheet, const ParameterFit& fit) {
  fmt::print("{}: {} segments of {:g} s\n\n", sheet.rig, fit.segments, fit.segment_duration);
  fmt::print("{:<26} {:>11} {:>11} {:>24}  {:<20} {}\n", "parameter", "datasheet", "estimate", "90 % interval", "unit",
             "change");
  for (const FittedParameter& p : fit.parameters) {
    if (!p.determined) continue;
    fmt::print("{:<26} {:>11.4g} {:>11.4g} {:>11.4g}..{:<11.4g}  {:<20} {:+.1f} %\n", p.name, p.nominal, p.estimate,
               p.low, p.high, p.unit, 100 * (p.estimate / p.nominal - 1));
  }
  for (const FittedParameter& p : fit.parameters)
    if (!p.determined)
      fmt::print("{:<26} {:>11.4g} {:>11.4g} not determined: {}\n", p.name, p.nominal, p.estimate, p.reason);
  fmt::print("\n{:<26} {:>11} {:>11} {:>11} {:>11}  {}\n", "residual, rms", "noise", "before", "after", "free run",
             "unit");
  for (const ChannelMisfit& c : fit.channels)
    fmt::print("{:<26} {:>11.3g} {:>11.3g} {:>11.3g} {:>11.3g}  {}\n", c.channel, c.noise, c.before, c.after, c.free,
               c.unit);
  if (!fit.remarks.empty()) fmt::print("\n");
  for (const std::string& remark : fit.remarks) fmt::print("{}\n", remark);
}

// The datasheet with what was found as nominal values and tolerances.
void write_patch(const Datasheet& sheet, const ParameterFit& fit, const std::string& file) {
  std::string text = datasheet_text(sheet);
  std::vector<std::string> remarks;
  for (const FittedParameter& p : fit.parameters) {
    // Those of a combination belong together, so all are written.
    set_parameter(sheet, text, p.name, "nominal", p.estimate);
    const double tolerance = 0.5 * (p.high - p.low) / kNinetyPercentSigmas / std::abs(p.estimate);
    if (tolerance > kWidestTolerance)
      remarks.push_back(
          fmt::format("{}: {} has the tolerance {:.3g} there, the widest that a datasheet may have; "
                      "these runs leave {:.2g}",
                      file, p.name, kWidestTolerance, tolerance));
    set_parameter(sheet, text, p.name, "tolerance", std::min(tolerance, kWidestTolerance));
  }
  write_datasheet(text, file);
  print_remarks("fit", remarks);
}

void run(const Options& options) {
  std::vector<std::pair<std::string, Recording>> runs;
  const Datasheet sheet = load_datasheet(options.rig, options.config);
  for (const std::string& file : options.runs) {
    LoadedRecording loaded = load_recording(file, options.rig, options.config, Period::of_run);
    keep_own_samples(file, loaded);
    print_remarks("fit", loaded.remarks);
    runs.emplace_back(file, std::move(loaded.recording));
  }
  if (sheet.defaulted.count("identify") > 0)
    print_remarks("fit",
                  {sheet.file + ": no parameter is marked 'identify: true'; those with a tolerance are estimated"});
  const int jobs = options.jobs > 0 ? options.jobs : usable_cores();
  const bool tell = isatty(fileno(stderr)) != 0;
  const auto say = [tell](const std::string& text) {
    if (tell) std::fputs(fmt::format("fit: {}\n", text).c_str(), stderr);
  };
  const ParameterFit fit = fit_parameters(sheet, std::move(runs), jobs, say, FitOptions(), time_limit(options.minutes));
  if (!options.json.empty()) write_text(options.json, json_text(result_json(sheet, options.runs, fit)));
  if (options.json != "-") print_result(sheet, fit);
  if (!options.patch.empty()) write_patch(sheet, fit, options.patch);
}

std::function<void()> add(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  app.add_option("RIG", options->rig, "the rig; its datasheet marks what is estimated with 'identify: true'")
      ->required();
  add_input(app, "RUN", options->runs, "recordings, .bag or .csv, of the rig without faults")->required();
  add_input(app, "--config", options->config, "a datasheet to read instead of the rig's own");
  add_text_output(app, "--json", options->json, "write the answer as JSON to this file; - is standard output");
  add_output(app, "--patch", options->patch,
             "write the datasheet with the estimates as nominal values and tolerances to this file, for --config");
  app.add_option("--jobs", options->jobs, "threads; all cores without it")->check(whole_number(1, 256));
  add_minutes(app, options->minutes,
              "after which what only secures the answer is left out: rounds, other starts, the walls of intervals");
  return [options] { run(*options); };
}

FAULTLINE_SUBCOMMAND(fit, {"fit", "estimate a rig's parameters from recordings, with intervals",
                           "faultline fit RIG prbs1.bag prbs2.bag --patch mine.yaml", add});

}  // namespace
}  // namespace faultline

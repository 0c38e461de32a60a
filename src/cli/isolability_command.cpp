// `faultline isolability`: which faults a run could tell apart, from the rig's model; no fault need be in the run.
#include <algorithm>
#include <cmath>
#include <memory>

#include <fmt/format.h>

#include "cli/json_text.h"
#include "cli/load_recording.h"
#include "cli/options.h"
#include "cli/output_file.h"
#include "cli/subcommand.h"
#include "faultline/estimators/response_core.h"
#include "faultline/estimators/stretch_collector.h"
#include "faultline/numerics/usable_cores.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kAllStretches = 1e6;  // the whole run counts

struct Options {
  std::string run, rig, config, json;
  double alike = 0.95;
  bool trace = false;
};

ResponseSettings settings_of(const Datasheet& sheet) {
  ResponseSettings settings = response_settings(sheet);
  settings.memory_stretches = kAllStretches;
  settings.refresh_stretches = 1;  // every stretch counts
  settings.jobs = usable_cores();
  return settings;
}

void run(const Options& options) {
  const LoadedRecording loaded = load_recording(options.run, options.rig, options.config);
  print_remarks("isolability", loaded.remarks);
  const ResponseSettings settings = settings_of(loaded.sheet);
  StretchCollector collector(loaded.sheet, settings);
  FaultResponses responses(loaded.sheet, settings);
  std::size_t stretches = 0;
  for (std::size_t k = 0; k < loaded.recording.rows(); ++k) {
    const double* row = loaded.recording.row(k);
    bool good = true;  // a number that is missing ends a stretch
    for (std::size_t c = 0; c < loaded.sheet.channels.size(); ++c)
      good = good && (std::isfinite(row[c]) || loaded.sheet.channels[c].ground_truth);
    const auto stretch = collector.add(loaded.recording.time[k] - loaded.start, row, good);
    if (!stretch) continue;
    responses.judge(*stretch);
    ++stretches;
    if (!options.trace) continue;
    fmt::print("{:8.2f} {:10.1f}", loaded.recording.time[k] - loaded.start, responses.evidence());
    for (const RankedFault& r : responses.first())
      fmt::print("  {} {:.3g} ({:.0f})", responses.hypotheses()[r.hypothesis].name(),
                 responses.hypotheses()[r.hypothesis].size(r.amplitude), r.evidence);
    if (!responses.second().empty()) {
      fmt::print("  AND");
      for (const RankedFault& r : responses.second())
        fmt::print("  {} {:.3g} ({:.0f})", responses.hypotheses()[r.hypothesis].name(),
                   responses.hypotheses()[r.hypothesis].size(r.amplitude), r.evidence);
    }
    fmt::print("\n");
  }
  if (options.trace) return;
  if (stretches == 0)
    throw InputError(fmt::format("{}: too short; at least {:g} s without a gap or a missing number are needed",
                                 options.run, settings.stretch_s()));
  const std::vector<FaultHypothesis>& hypotheses = responses.hypotheses();
  const Eigen::MatrixXd cosines = responses.cosines();
  const std::vector<double> errors = responses.amplitude_errors();
  Json json = {{"rig", loaded.sheet.rig}, {"run", options.run}, {"faults", Json::array()}, {"cosines", Json::array()}};
  std::string table = fmt::format("{:<52} {:>12} {:<18} {}\n", "fault", "least size", "unit", "like (cosine)");
  for (std::size_t h = 0; h < hypotheses.size(); ++h) {
    const FaultHypothesis& f = hypotheses[h];
    const double least = std::sqrt(settings.threshold_evidence) * errors[h];
    const bool seen = least <= std::max(std::abs(f.lowest), f.highest);
    std::vector<std::pair<double, std::size_t>> alike;
    Json row = Json::array();
    for (std::size_t other = 0; other < hypotheses.size(); ++other) {
      const double c = cosines(static_cast<Eigen::Index>(h), static_cast<Eigen::Index>(other));
      row.push_back(std::round(c * 1e4) / 1e4);
      if (other != h && std::abs(c) >= options.alike) alike.push_back({-std::abs(c), other});
    }
    json["cosines"].push_back(row);
    json["faults"].push_back({{"effect", f.effect},
                              {"port", f.port},
                              {"size_name", f.size_name},
                              {"unit", f.size_unit},
                              {"least_size", seen ? Json(f.size(least)) : Json()}});
    std::sort(alike.begin(), alike.end());
    std::string like;
    for (const auto& [c, other] : alike)
      like += fmt::format("{}{} {:.2f}", like.empty() ? "" : ", ", hypotheses[other].name(), -c);
    table += fmt::format("{:<52} {:>12} {:<18} {}\n", f.name() + (f.size_name.empty() ? "" : ":" + f.size_name),
                         seen ? fmt::format("{:.4g}", f.size(least)) : "not seen", f.size_unit, like);
  }
  if (!options.json.empty()) write_text(options.json, json_text(json));
  if (options.json != "-") fmt::print("{}", table);
}

std::function<void()> add(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  add_input(app, "RUN", options->run, "a recording, .bag or .csv: its motion decides what can be told apart")
      ->required();
  app.add_option("--rig", options->rig, "the rig; needed for a .csv, and where a bag holds several");
  app.add_option("--alike", options->alike, "cosine from which faults are listed as alike [0.95]")
      ->check(number_between(0.0, 1.0));
  app.add_flag("--trace", options->trace, "instead, what is found stretch by stretch");
  add_input(app, "--config", options->config, "a datasheet to read instead of the rig's own");
  add_text_output(app, "--json", options->json,
                  "write faults and all cosines as JSON to this file; - is standard output");
  return [options] { run(*options); };
}

FAULTLINE_SUBCOMMAND(isolability, {"isolability", "say which faults the motion of a run could show and tell apart",
                                   "faultline isolability healthy.bag", add});

}  // namespace
}  // namespace faultline

// `faultline explain`: by which channels the others are explained, as entropy says, for the stage of type histogram.
#include <algorithm>
#include <memory>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cli/json_text.h"
#include "cli/load_recording.h"
#include "cli/options.h"
#include "cli/output_file.h"
#include "cli/subcommand.h"
#include "faultline/estimators/explanatory.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

using Json = nlohmann::ordered_json;

struct Options {
  std::string run, rig, config, json;
  std::vector<std::string> of, by;
  ExplanatoryOptions entropy;
};

std::vector<std::size_t> channels(const Datasheet& sheet, const std::vector<std::string>& names, bool explanatory) {
  std::vector<std::size_t> found;
  for (const std::string& name : names) found.push_back(static_cast<std::size_t>(sheet.channel(name)));
  if (!names.empty()) return found;
  // Commands are what a rig without set points is asked for.
  const bool asked = std::any_of(sheet.channels.begin(), sheet.channels.end(),
                                 [](const Channel& c) { return c.role == Role::setpoint && !c.ground_truth; });
  for (std::size_t c = 0; c < sheet.channels.size(); ++c) {
    const Role role = sheet.channels[c].role;
    if (sheet.channels[c].ground_truth) continue;
    const bool given = role == Role::setpoint || role == Role::input || (role == Role::command && !asked);
    if (explanatory ? given : role != Role::input) found.push_back(c);
  }
  return found;
}

void run(const Options& options) {
  const LoadedRecording loaded = load_recording(options.run, options.rig, options.config, Period::of_run);
  print_remarks("explain", loaded.remarks);
  const Datasheet& sheet = loaded.sheet;
  const std::vector<std::size_t> of = channels(sheet, options.of, false), by = channels(sheet, options.by, true);
  if (by.empty())
    throw InputError(
        fmt::format("{}: the rig {} has no set point and no input; name channels with --by", options.run, sheet.rig));
  const std::vector<Explained> all = explain(loaded.recording, of, by, options.entropy);
  if (all.empty())
    throw InputError(
        fmt::format("{}: in no row are all of these channels numbers; name fewer with --of and --by", options.run));
  const auto name = [&](std::size_t c) { return sheet.channels[c].name; };
  const auto names = [&](const std::vector<std::size_t>& list) {
    std::vector<std::string> result;
    for (const std::size_t c : list) result.push_back(name(c));
    return result;
  };
  Json json = {{"rig", sheet.rig},
               {"run", options.run},
               {"bins", options.entropy.bins},
               {"sections", options.entropy.sections},
               {"least", options.entropy.least},
               {"variables", Json::array()}};
  std::string table = fmt::format("{:<26} {:>7} {:>7}  {:<44} {}\n", "variable", "bit", "left", "explained by",
                                  "gain beyond chance, bit: alone; beside the first");
  std::string settings;
  for (const Explained& e : all) {
    const auto gains = [&](const std::vector<Gain>& list) {
      Json entries = Json::array();
      for (const Gain& g : list)
        entries.push_back({{"by", name(g.by)}, {"gain", g.gain}, {"chance", g.chance}, {"chance_most", g.most}});
      return entries;
    };
    json["variables"].push_back({{"name", name(e.observed)},
                                 {"entropy", e.entropy},
                                 {"left", e.left},
                                 {"explained_by", names(e.chosen)},
                                 {"first", gains(e.first)},
                                 {"second", gains(e.second)}});
    const auto text = [&](const std::vector<Gain>& list) {
      std::vector<std::string> parts;
      for (const Gain& g : list) parts.push_back(fmt::format("{} {:.2f}", name(g.by), g.beyond_chance()));
      return fmt::format("{}", fmt::join(parts, ", "));
    };
    const std::string chosen = fmt::format("{}", fmt::join(names(e.chosen), ", "));
    table += fmt::format("{:<26} {:>7.2f} {:>7.2f}  {:<44} {}{}{}\n", name(e.observed), e.entropy, e.left,
                         e.entropy > 0 ? (chosen.empty() ? "none" : chosen) : "it never moved", text(e.first),
                         e.second.empty() ? "" : "; ", text(e.second));
    if (e.entropy > 0)
      settings += fmt::format("    {}_by: \"{}\"\n", name(e.observed), chosen.empty() ? "none" : chosen);
  }
  if (!options.json.empty()) write_text(options.json, json_text(json));
  if (options.json != "-") fmt::print("{}\nfor a stage of type histogram:\n{}", table, settings);
}

std::function<void()> add(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  add_input(app, "RUN", options->run, "a healthy recording, .bag or .csv, that goes through the operating range")
      ->required();
  app.add_option("--rig", options->rig, "the rig; needed for a .csv, and where a bag holds several");
  app.add_option("--of", options->of, "channels to explain, with commas between [all but inputs]")->delimiter(',');
  app.add_option("--by", options->by, "channels that may explain them [set points, else commands, and inputs]")
      ->delimiter(',');
  app.add_option("--bins", options->entropy.bins, "of an explanatory channel's range [8]")->check(whole_number(2, 64));
  app.add_option("--sections", options->entropy.sections, "of an explained channel's range [32]")
      ->check(whole_number(4, 1024));
  app.add_option("--least", options->entropy.least, "share of the entropy that a channel must explain [0.01]")
      ->check(number_between(0, 1));
  add_input(app, "--config", options->config, "a datasheet to read instead of the rig's own");
  add_text_output(app, "--json", options->json, "write all gains as JSON to this file; - is standard output");
  return [options] { run(*options); };
}

FAULTLINE_SUBCOMMAND(explain, {"explain", "say which channels explain which others in a run, by information entropy",
                               "faultline explain healthy.bag --by CHANNEL,CHANNEL", add});

}  // namespace
}  // namespace faultline

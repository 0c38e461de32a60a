// `faultline rigs`: what rigs there are, and for each its channels, states, parameters, ports and the effects that fit
// them.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cli/json_text.h"
#include "cli/load_recording.h"
#include "cli/options.h"
#include "cli/output_file.h"
#include "cli/share_folder.h"
#include "cli/subcommand.h"
#include "faultline/rig/default_sheet.h"
#include "faultline/rig/effect.h"
#include "faultline/rig/effect_unit.h"
#include "faultline/rig/rig.h"
#include "faultline/signal/error.h"
#include "nodes/rig_packages.h"

namespace faultline {
namespace {

using Json = nlohmann::ordered_json;

Json number(double value) {
  return std::isfinite(value) ? Json(value) : std::isnan(value) ? Json() : Json(value > 0 ? "inf" : "-inf");
}

// Bounds of one parameter of an effect at a port: what the port says, else what physics allows.
Json effect_json(const Datasheet& sheet, const Port& port, const FittingEffect& fitting) {
  Json effect = {{"effect", fitting.effect}, {"meaning", ""}, {"parameters", Json::array()}};
  const EffectType* type = find_effect_type(fitting.effect);
  if (!type) {
    effect["known"] = false;
    return effect;
  }
  effect["known"] = true;
  effect["meaning"] = type->meaning;
  for (const EffectParameter& parameter : type->parameters) {
    const auto bounds = fitting.bounds.find(parameter.name);
    effect["parameters"].push_back(
        {{"name", parameter.name},
         {"unit", parameter_unit(sheet, port, *type, parameter)},
         {"none", number(parameter.none)},
         {"minimum", number(bounds == fitting.bounds.end() ? parameter.minimum : bounds->second.minimum)},
         {"maximum", number(bounds == fitting.bounds.end() ? parameter.maximum : bounds->second.maximum)}});
  }
  return effect;
}

Json rig_json(const Datasheet& sheet) {
  Json rig = {{"rig", sheet.rig},
              {"title", sheet.title},
              {"datasheet", sheet.file},
              {"sample_period", sheet.sample_period},
              {"simulated", find_rig_type(sheet.rig) != nullptr},
              {"diagnosed", !sheet.estimators.empty()},
              {"filled_in", sheet.defaulted},
              {"channels", Json::array()},
              {"states", Json::array()},
              {"parameters", Json::array()},
              {"ports", Json::array()},
              {"profiles", Json::array()},
              {"faults", Json::array()}};
  for (const Channel& c : sheet.channels)
    rig["channels"].push_back({{"name", c.name},
                               {"symbol", c.symbol},
                               {"unit", c.unit},
                               {"role", to_string(c.role)},
                               {"minimum", number(c.minimum)},
                               {"maximum", number(c.maximum)},
                               {"noise_std", c.noise_std},
                               {"resolution", c.resolution},
                               {"ground_truth", c.ground_truth},
                               {"meaning", c.meaning}});
  for (const State& s : sheet.states)
    rig["states"].push_back({{"name", s.name}, {"symbol", s.symbol}, {"unit", s.unit}});
  for (const Parameter& p : sheet.parameters)
    rig["parameters"].push_back({{"name", p.name},
                                 {"symbol", p.symbol},
                                 {"unit", p.unit},
                                 {"nominal", p.nominal},
                                 {"tolerance", p.tolerance},
                                 {"identify", p.identify},
                                 {"from", p.from}});
  for (const Port& p : sheet.ports) {
    Json port = {{"name", p.name},
                 {"kind", to_string(p.kind)},
                 {"component", p.component},
                 {"meaning", p.meaning},
                 {"effects", Json::array()}};
    for (const FittingEffect& fitting : p.effects) port["effects"].push_back(effect_json(sheet, p, fitting));
    rig["ports"].push_back(port);
  }
  for (const Profile& p : sheet.profiles)
    rig["profiles"].push_back({{"name", p.name},
                               {"controller", p.controller.empty() ? "open loop" : p.controller},
                               {"duration", p.duration},
                               {"meaning", p.meaning}});
  for (const Fault& f : sheet.faults)
    rig["faults"].push_back({{"name", f.name}, {"effects", f.effects}, {"profile", f.profile}, {"meaning", f.meaning}});
  return rig;
}

std::string status_of(const Datasheet& sheet) {
  std::string text = find_rig_type(sheet.rig) ? "simulated" : "datasheet only: no equations in this build";
  if (!sheet.estimators.empty()) text += ", diagnosed";
  return text;
}

void print_list(const std::vector<Datasheet>& sheets) {
  fmt::print("{:<18} {:>8} {:>10} {:>5}  {}\n", "rig", "channels", "parameters", "ports", "");
  for (const Datasheet& sheet : sheets) {
    fmt::print("{:<18} {:>8} {:>10} {:>5}  {}\n", sheet.rig, sheet.channels.size(), sheet.parameters.size(),
               sheet.ports.size(), status_of(sheet));
    fmt::print("    {}\n", sheet.title);
  }
  fmt::print("More on one of them: faultline rigs RIG\n");
}

void print_rig(const Datasheet& sheet) {
  fmt::print("{}: {}\n{}; sample period {:g} s\n", sheet.rig, sheet.title, status_of(sheet), sheet.sample_period);
  fmt::print("\n{:<24} {:<10} {:<9} {:>10} {:>10}\n", "channel", "unit", "role", "from", "to");
  for (const Channel& c : sheet.channels)
    fmt::print("{:<24} {:<10} {:<9} {:>10.4g} {:>10.4g}{}\n", c.name, c.unit, to_string(c.role), c.minimum, c.maximum,
               c.ground_truth ? "  ground truth" : "");
  fmt::print("\n{:<24} {}\n", "state", "unit");
  for (const State& s : sheet.states) fmt::print("{:<24} {}\n", s.name, s.unit);
  fmt::print("\n{:<26} {:>11} {:<20} {}\n", "parameter", "nominal", "unit", "tolerance");
  for (const Parameter& p : sheet.parameters)
    fmt::print("{:<26} {:>11.4g} {:<20} {:g} %\n", p.name, p.nominal, p.unit, 100 * p.tolerance);
  fmt::print("\nport, and the effects that fit it\n");
  for (const Port& port : sheet.ports) {
    fmt::print("{:<30} {}\n", port.name, port.component);
    for (const FittingEffect& fitting : port.effects) {
      const EffectType* type = find_effect_type(fitting.effect);
      std::string bounds;
      for (const auto& entry : fitting.bounds) {
        const int index = type ? type->parameter_index(entry.first) : -1;
        const std::string unit =
            index >= 0 ? parameter_unit(sheet, port, *type, type->parameters[static_cast<std::size_t>(index)]) : "s";
        bounds += fmt::format("  {} {:g}..{:g} [{}]", entry.first, entry.second.minimum, entry.second.maximum, unit);
      }
      fmt::print("    {:<24}{}{}\n", fitting.effect, bounds, type ? "" : "  (not in this build)");
    }
  }
  fmt::print("\nprofiles:");
  for (const Profile& p : sheet.profiles) fmt::print(" {}", p.name);
  if (sheet.defaulted.count("profiles") > 0) fmt::print("  (filled in)");
  fmt::print("\nfaults:");
  for (const Fault& f : sheet.faults) fmt::print(" {}", f.name);
  fmt::print("\n");
  if (!sheet.defaulted.empty())
    fmt::print("The datasheet leaves out {}, which {} filled in: faultline rigs {} --defaults shows what\n",
               fmt::join(sheet.defaulted, ", "), sheet.defaulted.size() > 1 ? "are" : "is", sheet.rig);
}

std::vector<Datasheet> all_datasheets() {
  const std::string own = share_folder() + "/config";
  std::vector<Datasheet> sheets = read_datasheets(own);
  for (const RigPlace& place : outside_rigs()) {
    try {
      if (!place.rig.empty()) sheets.push_back(find_datasheet(own, outside_rigs(), place.rig));
    } catch (const InputError& error) {
      print_remarks("rigs", {error.what()});
    }
    if (place.rig.empty()) print_remarks("rigs", {place.trouble});
  }
  std::sort(sheets.begin(), sheets.end(), [](const Datasheet& a, const Datasheet& b) { return a.rig < b.rig; });
  return sheets;
}

struct Options {
  std::string rig, config, json;
  bool defaults = false;
};

void run(const Options& options) {
  std::vector<Datasheet> sheets;
  if (options.defaults && options.rig.empty() && options.config.empty())
    throw InputError("--defaults: name one rig, or a datasheet with --config");
  if (!options.rig.empty() || !options.config.empty())
    sheets.push_back(load_datasheet(options.rig, options.config));
  else
    sheets = all_datasheets();
  if (options.defaults) {
    fmt::print("{}", defaulted_text(sheets.front()));
    return;
  }
  if (!options.json.empty()) {
    Json all = Json::array();
    for (const Datasheet& sheet : sheets) all.push_back(rig_json(sheet));
    write_text(options.json, json_text(Json({{"rigs", all}})));
    if (options.json == "-") return;
  }
  if (!options.rig.empty() || !options.config.empty())
    print_rig(sheets.front());
  else
    print_list(sheets);
}

std::function<void()> add(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  app.add_option("RIG", options->rig, "show this rig only, in full");
  add_input(app, "--config", options->config, "a datasheet to read instead of the rig's own");
  app.add_flag("--defaults", options->defaults, "print what the datasheet leaves out and is filled in, as YAML");
  add_text_output(app, "--json", options->json, "write everything as JSON to this file; - is standard output");
  return [options] { run(*options); };
}

FAULTLINE_SUBCOMMAND(rigs, {"rigs", "list the rigs: channels, states, parameters, ports and fitting effects",
                            "faultline rigs RIG --json rig.json", add});

}  // namespace
}  // namespace faultline

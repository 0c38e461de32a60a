// `faultline effects`: what can be injected, estimated and diagnosed, whatever the rig: every effect with its formula,
// parameters and the kinds of ports that it fits.
#include <cmath>
#include <memory>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cli/json_text.h"
#include "cli/load_recording.h"
#include "cli/options.h"
#include "cli/output_file.h"
#include "cli/subcommand.h"
#include "faultline/rig/effect.h"
#include "faultline/signal/error.h"
#include "nodes/rig_packages.h"

namespace faultline {
namespace {

using Json = nlohmann::ordered_json;

Json number(double value) {
  return std::isfinite(value) ? Json(value) : std::isnan(value) ? Json() : Json(value > 0 ? "inf" : "-inf");
}

std::vector<std::string> kinds_of(const EffectType& type) {
  std::vector<std::string> kinds;
  for (const PortKind kind : type.fits) kinds.push_back(to_string(kind));
  return kinds;
}

Json effect_json(const EffectType& type) {
  Json effect = {{"effect", type.name},
                 {"family", type.family},
                 {"formula", type.meaning},
                 {"ports", kinds_of(type)},
                 {"parameters", Json::array()}};
  for (const EffectParameter& p : type.parameters)
    effect["parameters"].push_back({{"name", p.name},
                                    {"unit", p.unit},
                                    {"none", number(p.none)},
                                    {"usual", number(p.usual)},
                                    {"minimum", number(p.minimum)},
                                    {"maximum", number(p.maximum)}});
  return effect;
}

std::string told_of(const EffectParameter& p) {
  if (!is_shape(p)) return fmt::format(", none at {:g}", p.none);
  return std::isnan(p.usual) ? "" : fmt::format(", {:g} if not given", p.usual);
}

void print(const EffectType& type) {
  fmt::print("{:<24} {}\n    at {}\n    {}\n", type.name, type.family, fmt::join(kinds_of(type), ", "), type.meaning);
  for (const EffectParameter& p : type.parameters)
    fmt::print("    {:<20} {:<34} {:g} to {:g}\n", p.name, fmt::format("[{}]{}", p.unit, told_of(p)), p.minimum,
               p.maximum);
}

void run(const std::string& json) {
  // Packages outside may bring effects too.
  for (const RigPlace& place : outside_rigs()) {
    try {
      if (!place.rig.empty()) load_rig(place);
    } catch (const InputError& error) {
      print_remarks("effects", {error.what()});
    }
  }
  if (!json.empty()) {
    Json all = Json::array();
    for (const EffectType& type : effect_types()) all.push_back(effect_json(type));
    write_text(json, json_text(Json({{"effects", all}})));
    if (json == "-") return;
  }
  for (const EffectType& type : effect_types()) print(type);
  fmt::print("{} effects. u: what passes the port; unit 'port': its unit. Sizes: a rig's datasheet narrows them.\n",
             effect_types().size());
}

std::function<void()> add(CLI::App& app) {
  const auto json = std::make_shared<std::string>();
  add_text_output(app, "--json", *json, "write them as JSON to this file; - is standard output");
  return [json] { run(*json); };
}

FAULTLINE_SUBCOMMAND(effects, {"effects", "list the effects: formula, parameters and units, kinds of ports",
                               "faultline effects --json effects.json", add});

}  // namespace
}  // namespace faultline

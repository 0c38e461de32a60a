// Reads a datasheet section by section; what each key means is told in docs/datasheet.md. Checked here: keys, types,
// ranges, units, signs, that names refer to something in the same datasheet, and that the library has the effects with
// these parameters and bounds. rig/datasheet_check.cpp then holds the whole against the equations. Stages are checked
// by the library when they are made.
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <utility>

#include "faultline/rig/datasheet_check.h"
#include "faultline/rig/datasheet_sections.h"
#include "faultline/rig/default_sheet.h"
#include "faultline/rig/effect.h"
#include "faultline/rig/nearest_name.h"
#include "faultline/signal/error.h"
#include "faultline/signal/units.h"

namespace faultline {
namespace datasheet_sections {

void add_unique(Names& names, const YamlValue& entry, const std::string& name) {
  if (!names.insert(name).second) entry.fail(fmt::format("uses the name '{}' a second time; names must differ", name));
}

std::vector<YamlValue> list_at(const YamlValue& root, const std::string& key) {
  return root.has(key) ? root.at(key).items() : std::vector<YamlValue>{};
}

std::vector<YamlValue> mapping_at(const YamlValue& root, const std::string& key) {
  return root.has(key) ? root.at(key).entries() : std::vector<YamlValue>{};
}

std::string text_or(const YamlValue& entry, const std::string& key, const std::string& fallback) {
  return entry.has(key) ? entry.at(key).text() : fallback;
}

const Channel& channel_named(const Datasheet& sheet, const YamlValue& place, const std::string& name) {
  const int index = find_channel(sheet.channels, name);
  if (index >= 0) return sheet.channels[static_cast<std::size_t>(index)];
  std::vector<std::string> names;
  for (const Channel& channel : sheet.channels) names.push_back(channel.name);
  place.fail(fmt::format("names channel '{}', which the rig does not have; channels are {}{}", name, joined(names),
                         did_you_mean(name, names)));
}

std::string unit_of(const YamlValue& value, bool must_be_si) {
  std::string text = value.text();
  bool si = false;
  try {
    si = is_si(parse_unit(text));
  } catch (const InputError& error) {
    value.fail(fmt::format("is not allowed: {}", error.what()));
  }
  if (must_be_si && !si)
    value.fail(
        fmt::format("is '{}'; channels and states are in SI units, as the equations are (m, kg, s, K, Pa, 1)", text));
  return text;
}

std::string positive_quantity(const std::string& unit) {
  static const std::pair<const char*, const char*> kinds[] = {
      {"m^2", "an area"},         {"m^3", "a volume"},           {"kg", "a mass"},
      {"kg m^2", "an inertia"},   {"kg/m^3", "a density"},       {"s", "a time"},
      {"K", "a temperature"},     {"m^3/rad", "a displacement"}, {"J/(kg K)", "a specific heat"},
      {"J/K", "a heat capacity"}, {"m^3/Pa", "a compliance"},    {"kg/Pa", "a compliance"},
      {"Pa s", "a viscosity"},    {"m^2/s", "a viscosity"},
  };
  const Unit wanted = parse_unit(unit);
  for (const auto& [of, what] : kinds)
    if (parse_unit(of).dimension == wanted.dimension) return what;
  return "";
}

void check_sign(const YamlValue& value, const std::string& unit, double number) {
  const std::string what = positive_quantity(unit);
  if (!what.empty() && number <= 0) value.fail(fmt::format("is {:g} {}; {} must be above 0", number, unit, what));
}

}  // namespace datasheet_sections

namespace {

using namespace datasheet_sections;

Role read_role(const YamlValue& value) {
  const std::string word = value.text();
  for (const Role role : {Role::setpoint, Role::command, Role::input, Role::output})
    if (word == to_string(role)) return role;
  value.fail(fmt::format("is '{}'; allowed are setpoint, command, input, output", word));
}

Channel read_channel(const YamlValue& entry) {
  entry.allow({"name", "symbol", "unit", "role", "range", "noise_std", "resolution", "meaning"},
              {"ground_truth", "predicted_by"});
  Channel channel;
  channel.name = entry.at("name").name();
  channel.symbol = entry.at("symbol").text();
  channel.unit = unit_of(entry.at("unit"), true);
  channel.role = read_role(entry.at("role"));
  const std::vector<double> range = entry.at("range").numbers();
  if (range.size() != 2) entry.at("range").fail("must be [minimum, maximum]");
  if (range[0] >= range[1])
    entry.at("range").fail(fmt::format("has a minimum {:g} that is not below its maximum {:g}", range[0], range[1]));
  channel.minimum = range[0];
  channel.maximum = range[1];
  channel.noise_std = entry.at("noise_std").number(0);
  channel.resolution = entry.at("resolution").number(0);
  channel.meaning = entry.at("meaning").text();
  if (entry.has("ground_truth")) channel.ground_truth = entry.at("ground_truth").truth();
  if (entry.has("predicted_by")) {
    if (channel.role != Role::input) entry.at("predicted_by").fail("is for channels of role input only");
    channel.predicted_by = entry.at("predicted_by").name();
  }
  return channel;
}

void read_channels(const YamlValue& root, Datasheet& sheet) {
  Names names;
  const std::vector<YamlValue> entries = YamlValue::expanded(root.at("channels").items());
  for (const YamlValue& entry : entries) {
    sheet.channels.push_back(read_channel(entry));
    add_unique(names, entry, sheet.channels.back().name);
    sheet.places["channels." + sheet.channels.back().name] = entry.place();
  }
  if (entries.empty()) root.at("channels").fail("must have at least one channel");
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const std::string& command = sheet.channels[i].predicted_by;
    if (!command.empty() && channel_named(sheet, entries[i].at("predicted_by"), command).role != Role::command)
      entries[i].at("predicted_by").fail(fmt::format("names channel '{}', which is not a command", command));
  }
  for (const YamlValue& entry : YamlValue::expanded(list_at(root, "not_recorded"))) {
    entry.allow({"name", "symbol", "unit", "meaning"}, {});
    Channel channel;
    channel.name = entry.at("name").name();
    channel.symbol = entry.at("symbol").text();
    channel.unit = unit_of(entry.at("unit"), true);
    channel.meaning = entry.at("meaning").text();
    add_unique(names, entry, channel.name);
    sheet.not_recorded.push_back(channel);
  }
}

// The channel that measures a state: an output in the same unit.
int read_measured_by(const YamlValue& value, const Datasheet& sheet, const State& state) {
  const Channel& channel = channel_named(sheet, value, value.name());
  if (channel.role != Role::output)
    value.fail(
        fmt::format("names channel '{}', whose role is {}; it must be output", channel.name, to_string(channel.role)));
  if (parse_unit(channel.unit).dimension != parse_unit(state.unit).dimension)
    value.fail(
        fmt::format("names channel '{}' in {}, but the state is in {}; correct the unit, or leave the key out if "
                    "the channel measures something else",
                    channel.name, channel.unit, state.unit));
  for (const State& other : sheet.states)
    if (other.channel >= 0 && sheet.channels[static_cast<std::size_t>(other.channel)].name == channel.name)
      value.fail(fmt::format("names channel '{}', which measures the state '{}' already", channel.name, other.name));
  return find_channel(sheet.channels, channel.name);
}

// What people write about a start value may be prose; words of several parts in it are names, or symbols, of the
// datasheet.
void check_names_in(const YamlValue& value, const Names& known) {
  const std::string text = value.text();
  const std::string letters = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_";
  for (std::size_t begin = text.find_first_of(letters); begin != std::string::npos;) {
    const std::size_t end = std::min(text.find_first_not_of(letters, begin), text.size());
    const std::string word = text.substr(begin, end - begin);
    if (word.find('_') != std::string::npos && known.count(word) == 0)
      value.fail(fmt::format("speaks of '{}', which is no channel, state, parameter, constant or symbol here{}", word,
                             did_you_mean(word, {known.begin(), known.end()})));
    begin = text.find_first_of(letters, end);
  }
}

void read_states(const YamlValue& root, Datasheet& sheet) {
  Names names;
  for (const YamlValue& entry : YamlValue::expanded(root.at("states").items())) {
    entry.allow({"name", "symbol", "unit"}, {"measured_by", "initial", "meaning"});
    text_or(entry, "meaning", "");
    State state;
    state.name = entry.at("name").name();
    state.symbol = entry.at("symbol").text();
    state.unit = unit_of(entry.at("unit"), true);
    if (entry.has("measured_by")) state.channel = read_measured_by(entry.at("measured_by"), sheet, state);
    add_unique(names, entry, state.name);
    sheet.places["states." + state.name] = entry.place();
    sheet.states.push_back(state);
  }
}

// Once all names are known.
void check_initial(const YamlValue& root, const Datasheet& sheet) {
  Names known;
  for (const auto& channel : sheet.channels) known.insert({channel.name, channel.symbol});
  for (const auto& state : sheet.states) known.insert({state.name, state.symbol});
  for (const auto& parameter : sheet.parameters) known.insert({parameter.name, parameter.symbol});
  for (const auto& constant : sheet.constants) known.insert(constant.first);
  for (const YamlValue& entry : YamlValue::expanded(root.at("states").items()))
    if (entry.has("initial")) check_names_in(entry.at("initial"), known);
}

constexpr double kLargestSpread = 0.5;  // tolerance at which the two that are drawn at most reach 0

void read_parameters(const YamlValue& root, Datasheet& sheet) {
  Names names;
  for (const YamlValue& entry : YamlValue::expanded(root.at("parameters").items())) {
    entry.allow({"name", "symbol", "unit", "nominal", "tolerance", "from"}, {"identify", "positive"});
    Parameter parameter;
    parameter.name = entry.at("name").name();
    parameter.symbol = entry.at("symbol").text();
    parameter.unit = unit_of(entry.at("unit"), false);
    parameter.nominal = entry.at("nominal").number();
    parameter.tolerance = entry.at("tolerance").number(0);
    parameter.from = entry.at("from").text();
    if (entry.has("identify")) parameter.identify = entry.at("identify").truth();
    std::string positive = positive_quantity(parameter.unit);
    if (entry.has("positive")) positive = entry.at("positive").truth() ? "what is declared positive" : "";
    if (!positive.empty() && parameter.nominal <= 0)
      entry.at("nominal").fail(
          fmt::format("is {:g} {}; {} must be above 0", parameter.nominal, parameter.unit, positive));
    if (!positive.empty() && parameter.tolerance >= kLargestSpread)
      entry.at("tolerance")
          .fail(fmt::format("is {:g}, with which the parameter may be 0; below {:g} it stays above",
                            parameter.tolerance, kLargestSpread));
    if (parameter.identify && parameter.nominal == 0)
      entry.at("nominal").fail("is 0, which gives 'identify' no scale; give the size that it may have");
    add_unique(names, entry, parameter.name);
    sheet.places["parameters." + parameter.name] = entry.place();
    sheet.parameters.push_back(parameter);
  }
  for (const YamlValue& entry : mapping_at(root, "constants")) {
    entry.allow({"value", "unit", "from"}, {"symbol"});
    entry.at("from").text();
    text_or(entry, "symbol", "");
    sheet.constants[entry.key()] = entry.at("value").number();
    check_sign(entry.at("value"), unit_of(entry.at("unit"), false), sheet.constants[entry.key()]);
  }
  for (const YamlValue& entry : mapping_at(root, "tables")) {
    entry.allow({"columns", "from"}, {});
    entry.at("from").text();
    Lookup table;
    table.name = entry.key();
    for (const YamlValue& column : entry.at("columns").entries()) {
      table.columns[column.key()] = column.numbers();
      const std::size_t rows = table.columns[column.key()].size();
      if (rows == 0 || rows != table.columns.begin()->second.size())
        column.fail(fmt::format("has {} numbers; all columns of a table need the same count, at least one", rows));
    }
    sheet.tables.push_back(table);
  }
}

// The effect must be one of the library's that fits the port, its bounds within what the effect allows.
FittingEffect read_fitting(const YamlValue& entry, const Port& port) {
  const EffectType* type = find_effect_type(entry.key());
  std::vector<std::string> known;
  for (const EffectType& candidate : effect_types())
    if (candidate.fits_kind(port.kind)) known.push_back(candidate.name);
  if (!type || !type->fits_kind(port.kind))
    entry.fail(fmt::format("is {}; at a {} port fit {}{}",
                           type ? "an effect for other kinds of ports" : "no effect that the library has",
                           to_string(port.kind), joined(known), did_you_mean(entry.key(), known)));
  known.clear();
  for (const EffectParameter& parameter : type->parameters) known.push_back(parameter.name);
  FittingEffect fitting;
  fitting.effect = type->name;
  for (const YamlValue& parameter : entry.entries()) {
    const int index = type->parameter_index(parameter.key());
    if (index < 0)
      parameter.fail(fmt::format("is no parameter of {}; it has {}{}", type->name, joined(known),
                                 did_you_mean(parameter.key(), known)));
    const EffectParameter& own = type->parameters[static_cast<std::size_t>(index)];
    const std::vector<YamlValue> ends = parameter.items();
    if (ends.size() != 2) parameter.fail("must be [minimum, maximum]");
    const Bounds bounds{ends[0].bound(), ends[1].bound()};
    if (bounds.minimum > bounds.maximum)
      parameter.fail(fmt::format("has a minimum {:g} above its maximum {:g}", bounds.minimum, bounds.maximum));
    if (bounds.minimum < own.minimum || bounds.maximum > own.maximum)
      parameter.fail(fmt::format("is [{:g}, {:g}], beyond what {} allows: {:g} to {:g} {}", bounds.minimum,
                                 bounds.maximum, type->name, own.minimum, own.maximum, own.unit));
    fitting.bounds[parameter.key()] = bounds;
  }
  if (fitting.bounds.empty()) entry.fail("must bound at least one parameter, as in {width: [0, 1]}");
  for (const EffectParameter& parameter : type->parameters)
    if (std::isnan(not_given(parameter)) && fitting.bounds.count(parameter.name) == 0)
      entry.fail(fmt::format("lacks bounds of '{}', without which the effect is not defined", parameter.name));
  return fitting;
}

// Of a rig whose flows or pressures are told in other quantities (levels in volts, mass flow). Effects are per second.
std::string read_drop_unit(const YamlValue& entry, const Port& port) {
  if (port.kind != PortKind::flow && port.kind != PortKind::restriction)
    entry.at("drop_unit").fail("is for flow and restriction ports only");
  if (port.kind == PortKind::flow && !entry.has("range"))
    entry.at("drop_unit")
        .fail("needs 'range', the largest such difference: a thousandth of it is where leaks are laminar");
  return unit_of(entry.at("drop_unit"), true);
}

// Of the sizes of effects at a port: on a rig that slides a shaft turns, too.
void read_units(const YamlValue& entry, Port& port) {
  for (const YamlValue& unit : entry.entries()) {
    const std::size_t dot = unit.key().find('.');
    const std::string effect = unit.key().substr(0, dot);
    const bool fits = std::any_of(port.effects.begin(), port.effects.end(),
                                  [&](const FittingEffect& fitting) { return fitting.effect == effect; });
    if (!fits || dot == std::string::npos || find_effect_type(effect)->parameter_index(unit.key().substr(dot + 1)) < 0)
      unit.fail("must be effect.parameter of an effect that this port lists, as in elasticity.compliance");
    port.units[unit.key()] = unit_of(unit, true);
  }
}

Port read_port(const YamlValue& entry, const Datasheet& sheet) {
  entry.allow({"component", "meaning", "effects"}, {"channel", "range", "unit", "drop_unit", "units"});
  Port port;
  port.name = entry.key();
  try {
    port.kind = port_kind(port.name);
  } catch (const InputError& error) {
    entry.fail(fmt::format("is not allowed: {}", error.what()));
  }
  const std::string place = port.name.substr(port.name.find('.') + 1);
  if (!is_name(place)) entry.fail("must be kind.place, the place made of lower-case letters, digits and _");
  port.component = entry.at("component").text();
  port.meaning = entry.at("meaning").text();
  if (entry.has("range")) port.range = entry.at("range").number();
  if (port.range <= 0) entry.at("range").fail("must be above 0");
  if (port.kind == PortKind::command || port.kind == PortKind::sensor) {
    const YamlValue named = entry.has("channel") ? entry.at("channel") : entry;
    port.channel = entry.has("channel") ? named.name() : place;
    const Role role = channel_named(sheet, named, port.channel).role;
    const bool fits =
        port.kind == PortKind::command ? role == Role::command : role == Role::input || role == Role::output;
    if (!fits)
      named.fail(fmt::format("passes channel '{}', whose role is {}; add 'channel: NAME' with a channel of role {}",
                             port.channel, to_string(role),
                             port.kind == PortKind::command ? "command" : "input or output"));
    if (entry.has("unit")) entry.at("unit").fail("is for other ports; here it is the channel's");
  } else if (entry.has("channel")) {
    entry.at("channel").fail("is for command and sensor ports only");
  } else if (entry.has("unit")) {
    port.unit = unit_of(entry.at("unit"), true);
    const std::string& unit = port.unit;
    if (port.kind == PortKind::flow && (unit.size() < 3 || unit.compare(unit.size() - 2, 2, "/s") != 0))
      entry.at("unit").fail("must be that of a flow, and end in /s");
  }
  if (entry.has("drop_unit")) port.drop_unit = read_drop_unit(entry, port);
  for (const YamlValue& effect : entry.at("effects").entries()) port.effects.push_back(read_fitting(effect, port));
  if (entry.has("units")) read_units(entry.at("units"), port);
  return port;
}

void read_ports(const YamlValue& root, Datasheet& sheet) {
  Names names;
  for (const YamlValue& entry : YamlValue::expanded(root.at("ports").entries())) {
    sheet.ports.push_back(read_port(entry, sheet));
    add_unique(names, entry, sheet.ports.back().name);
    sheet.places["ports." + sheet.ports.back().name] = entry.place();
  }
}

constexpr const char* kRigFile = "rig.yaml";
constexpr const char* kStagesFile = "stages.yaml";
constexpr std::array kStageKeys = {"estimators", "detectors", "isolators", "normal_gap", "segment"};

}  // namespace

Datasheet read_datasheet(const std::string& path) {
  // A file of another name than rig.yaml stands alone: it may hold the stages itself.
  const bool folder = std::filesystem::is_directory(path);
  const std::filesystem::path file = folder ? std::filesystem::path(path) / kRigFile : std::filesystem::path(path);
  YamlValue root = YamlValue::load(file.string());
  const std::vector<std::string> prose = {"conventions",    "layout",      "equations",       "estimator_form",
                                          "initial_state",  "integration", "reference_point", "leakage_conversion",
                                          "parameter_twins"};
  std::vector<std::string> optional = {"branches", "not_recorded",    "constants", "tables",
                                       "inputs",   "controllers",     "profiles",  "faults",
                                       "nuisance", "nominal_effects", "notes"};
  optional.insert(optional.end(), kStageKeys.begin(), kStageKeys.end());
  optional.insert(optional.end(), prose.begin(), prose.end());
  root.allow({"rig", "title", "source", "sample_period", "channels", "states", "parameters", "ports"}, optional);

  Datasheet sheet;
  sheet.file = file.string();
  sheet.rig = root.at("rig").name();
  sheet.title = root.at("title").text();
  sheet.source = root.at("source").text();
  sheet.sample_period = root.at("sample_period").number(1e-4, 100);  // s: 10 kHz to 0.01 Hz
  Names names;
  for (const YamlValue& branch : list_at(root, "branches")) {
    sheet.branches.push_back(branch.name());
    add_unique(names, branch, sheet.branches.back());
  }
  root.set_branches(sheet.branches);
  for (const char* section : {"channels", "states", "parameters", "ports"})
    sheet.places[section] = root.at(section).place();
  for (const std::string& key : prose) text_or(root, key, "");
  for (const YamlValue& note : list_at(root, "notes")) sheet.notes.push_back(note.text());

  read_channels(root, sheet);
  read_states(root, sheet);
  read_parameters(root, sheet);
  check_initial(root, sheet);
  read_ports(root, sheet);
  read_excitation(root, sheet);
  read_faults(root, sheet);
  read_diagnosis(root, sheet);
  Names given;
  for (const YamlValue& entry : root.entries()) given.insert(entry.key());
  const std::filesystem::path stages = file.parent_path() / kStagesFile;
  if (file.filename() == kRigFile && std::filesystem::exists(stages)) {
    for (const char* key : kStageKeys)
      if (root.has(key)) root.at(key).fail(fmt::format("belongs into {}, which stands beside this file", kStagesFile));
    YamlValue second = YamlValue::load(stages.string());
    second.allow({}, {kStageKeys.begin(), kStageKeys.end()});
    second.set_branches(sheet.branches);
    sheet.stages_file = stages.string();
    read_diagnosis(second, sheet);
    for (const YamlValue& entry : second.entries()) given.insert(entry.key());
  }
  check_datasheet(sheet);
  complete_datasheet(sheet, given);
  return sheet;
}

}  // namespace faultline

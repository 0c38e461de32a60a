// Reads a datasheet section by section; what each key means is told in docs/datasheet.md. Checked here: keys, types,
// ranges, and that names refer to something in the same datasheet. Not checked here: that the library has the effects,
// the stages and the controllers that are named, since it is the library that says so when they are made.
#include <fmt/format.h>

#include <array>
#include <filesystem>

#include "faultline/rig/datasheet_sections.h"
#include "faultline/signal/error.h"

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
  place.fail(fmt::format("names channel '{}', which the rig does not have; channels are {}", name, joined(names)));
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
  channel.unit = entry.at("unit").text();
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
    channel.unit = entry.at("unit").text();
    channel.meaning = entry.at("meaning").text();
    add_unique(names, entry, channel.name);
    sheet.not_recorded.push_back(channel);
  }
}

void read_states(const YamlValue& root, Datasheet& sheet) {
  Names names;
  for (const YamlValue& entry : YamlValue::expanded(root.at("states").items())) {
    entry.allow({"name", "symbol", "unit"}, {"initial", "meaning"});
    for (const char* key : {"initial", "meaning"}) text_or(entry, key, "");
    sheet.states.push_back({entry.at("name").name(), entry.at("symbol").text(), entry.at("unit").text()});
    add_unique(names, entry, sheet.states.back().name);
  }
}

void read_parameters(const YamlValue& root, Datasheet& sheet) {
  Names names;
  for (const YamlValue& entry : YamlValue::expanded(root.at("parameters").items())) {
    entry.allow({"name", "symbol", "unit", "nominal", "tolerance", "from"}, {"identify"});
    Parameter parameter;
    parameter.name = entry.at("name").name();
    parameter.symbol = entry.at("symbol").text();
    parameter.unit = entry.at("unit").text();
    parameter.nominal = entry.at("nominal").number();
    parameter.tolerance = entry.at("tolerance").number(0);
    parameter.from = entry.at("from").text();
    if (entry.has("identify")) parameter.identify = entry.at("identify").truth();
    add_unique(names, entry, parameter.name);
    sheet.parameters.push_back(parameter);
  }
  for (const YamlValue& entry : mapping_at(root, "constants")) {
    entry.allow({"value", "unit", "from"}, {"symbol"});
    for (const char* key : {"unit", "from"}) entry.at(key).text();
    text_or(entry, "symbol", "");
    sheet.constants[entry.key()] = entry.at("value").number();
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

Port read_port(const YamlValue& entry, const Datasheet& sheet) {
  entry.allow({"component", "meaning", "effects"}, {"channel", "range"});
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
  } else if (entry.has("channel")) {
    entry.at("channel").fail("is for command and sensor ports only");
  }
  for (const YamlValue& effect : entry.at("effects").entries()) {
    FittingEffect fitting;
    fitting.effect = effect.key();
    for (const YamlValue& parameter : effect.entries()) {
      const std::vector<YamlValue> ends = parameter.items();
      if (ends.size() != 2) parameter.fail("must be [minimum, maximum]");
      const Bounds bounds{ends[0].bound(), ends[1].bound()};
      if (bounds.minimum > bounds.maximum)
        parameter.fail(fmt::format("has a minimum {:g} above its maximum {:g}", bounds.minimum, bounds.maximum));
      fitting.bounds[parameter.key()] = bounds;
    }
    if (fitting.bounds.empty()) effect.fail("must bound at least one parameter, as in {width: [0, 1]}");
    port.effects.push_back(fitting);
  }
  return port;
}

void read_ports(const YamlValue& root, Datasheet& sheet) {
  Names names;
  for (const YamlValue& entry : YamlValue::expanded(root.at("ports").entries())) {
    sheet.ports.push_back(read_port(entry, sheet));
    add_unique(names, entry, sheet.ports.back().name);
  }
}

constexpr const char* kRigFile = "rig.yaml";
constexpr const char* kStagesFile = "stages.yaml";
constexpr std::array kStageKeys = {"estimators", "detectors", "isolators", "normal_gap"};

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
  for (const std::string& key : prose) text_or(root, key, "");
  for (const YamlValue& note : list_at(root, "notes")) sheet.notes.push_back(note.text());

  read_channels(root, sheet);
  read_states(root, sheet);
  read_parameters(root, sheet);
  read_ports(root, sheet);
  read_excitation(root, sheet);
  read_faults(root, sheet);
  read_diagnosis(root, sheet);
  const std::filesystem::path stages = file.parent_path() / kStagesFile;
  if (file.filename() == kRigFile && std::filesystem::exists(stages)) {
    for (const char* key : kStageKeys)
      if (root.has(key)) root.at(key).fail(fmt::format("belongs into {}, which stands beside this file", kStagesFile));
    YamlValue second = YamlValue::load(stages.string());
    second.allow({}, {kStageKeys.begin(), kStageKeys.end()});
    second.set_branches(sheet.branches);
    sheet.stages_file = stages.string();
    read_diagnosis(second, sheet);
  }
  return sheet;
}

}  // namespace faultline

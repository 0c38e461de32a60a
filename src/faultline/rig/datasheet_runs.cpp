// Reads how a rig is run and diagnosed: measured inputs, controllers, profiles, faults, small effects that are always
// there, stages. What each key means is told in docs/datasheet.md. Shapes of profiles are made once, so that a wrong
// setting shows here; effects must be listed at their ports. rig/datasheet_check.cpp makes each controller once; stages
// are checked by whoever makes them.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "faultline/rig/datasheet_sections.h"
#include "faultline/rig/effect.h"
#include "faultline/rig/excitation.h"
#include "faultline/rig/nearest_name.h"
#include "faultline/signal/error.h"

namespace faultline::datasheet_sections {
namespace {

std::vector<std::string> list_of(const Names& names) { return {names.begin(), names.end()}; }

enum class Sizes { as_the_port_says, as_the_effect_allows };

// effect@port:name=value,...: the port must be one of the rig's, the effect and its parameters listed there, the sizes
// allowed.
std::string read_effect(const YamlValue& value, const Datasheet& sheet, Sizes sizes) {
  const std::string text = value.text();
  const auto at = text.find('@');
  const auto colon = text.find(':', at == std::string::npos ? 0 : at);
  if (at == std::string::npos || colon == std::string::npos)
    value.fail(fmt::format("is '{}'; write effect@port:name=value,...", text));
  const std::string effect = text.substr(0, at), port_name = text.substr(at + 1, colon - at - 1);
  const Port* port = nullptr;
  std::vector<std::string> known;
  for (const Port& candidate : sheet.ports) {
    known.push_back(candidate.name);
    if (candidate.name == port_name) port = &candidate;
  }
  if (!port)
    value.fail(fmt::format("names port '{}', which the rig does not have; ports are {}{}", port_name, joined(known),
                           did_you_mean(port_name, known)));
  const FittingEffect* fitting = nullptr;
  known.clear();
  for (const FittingEffect& candidate : port->effects) {
    known.push_back(candidate.effect);
    if (candidate.effect == effect) fitting = &candidate;
  }
  // What is free fits wherever its kind does, at any size (check_effect).
  const EffectType* known_type = find_effect_type(effect);
  const bool free = known_type && known_type->family == "free";
  if (!fitting && !free)
    value.fail(fmt::format("names effect '{}', which is not listed at {}; there are {}{}", effect, port_name,
                           joined(known), did_you_mean(effect, known)));
  EffectSpec spec;
  try {
    spec = parse_effect(text);
  } catch (const InputError& error) {
    value.fail(fmt::format("is not allowed: {}", error.what()));
  }
  if (free) return text;
  const EffectType& type = *known_type;
  for (std::size_t i = 0; i < type.parameters.size(); ++i) {
    const EffectParameter& parameter = type.parameters[i];
    const double size = spec.parameters[i];
    const auto bounds = fitting->bounds.find(parameter.name);
    const bool open =
        std::isfinite(parameter.usual) && bounds == fitting->bounds.end();  // the effect's own limits hold
    const bool none = size == not_given(parameter) || std::isnan(size) || open;
    if (!none && bounds == fitting->bounds.end())
      value.fail(fmt::format("gives '{}' in '{}', which has no bounds at {}", parameter.name, text, port_name));
    if (!none && sizes == Sizes::as_the_port_says && (size < bounds->second.minimum || size > bounds->second.maximum))
      value.fail(fmt::format("gives {}={:g} in '{}'; {} takes {:g} to {:g}", parameter.name, size, text, port_name,
                             bounds->second.minimum, bounds->second.maximum));
  }
  return text;
}

std::vector<std::string> read_effects(const YamlValue& entry, const std::string& key, const Datasheet& sheet,
                                      Sizes sizes = Sizes::as_the_port_says) {
  std::vector<std::string> effects;
  for (const YamlValue& value : list_at(entry, key)) effects.push_back(read_effect(value, sheet, sizes));
  return effects;
}

// A value of a channel that a run sets.
double value_of(const YamlValue& value, const Channel& channel) {
  return value.number(channel.minimum, channel.maximum);
}

// {b} has become a branch where the entry's name holds it; elsewhere, and in any other bracket, it would stay as it is.
std::string word_of(const YamlValue& value) {
  std::string word = value.text();
  if (word.find('{') != std::string::npos && word.find('}') != std::string::npos)
    value.fail(fmt::format("is '{}'; only {{b}} stands for a branch, in entries whose name holds it", word));
  return word;
}

// Every key of a mapping but those in `known`.
Settings read_settings(const YamlValue& entry, const Names& known) {
  std::map<std::string, double> numbers;
  std::map<std::string, std::vector<double>> lists;
  std::map<std::string, std::string> words;
  for (const YamlValue& value : entry.entries()) {
    if (known.count(value.key()) > 0) continue;
    if (!is_name(value.key())) value.fail("is not a name; settings have names of lower-case letters, digits and _");
    if (value.is_list())
      lists[value.key()] = value.numbers();
    else if (value.is_number())
      numbers[value.key()] = value.number();
    else
      words[value.key()] = word_of(value);
  }
  return {entry.place(), std::move(numbers), std::move(lists), std::move(words)};
}

CommandTable read_command(const YamlValue& entry, const Datasheet& sheet) {
  entry.allow({"time", "value"}, {});
  CommandTable table;
  table.channel = entry.key();
  const Channel& channel = channel_named(sheet, entry, table.channel);
  if (channel.role != Role::command) entry.fail("is not a channel of role command");
  table.time = entry.at("time").numbers();
  for (const YamlValue& value : entry.at("value").items()) table.value.push_back(value_of(value, channel));
  if (table.time.empty() || table.time.size() != table.value.size())
    entry.fail(fmt::format("has {} times and {} values; it needs as many of each, at least one", table.time.size(),
                           table.value.size()));
  for (std::size_t i = 1; i < table.time.size(); ++i)
    if (table.time[i] <= table.time[i - 1]) entry.at("time").fail("must rise from each number to the next");
  return table;
}

std::vector<StageSpec> read_stages(const YamlValue& root, const std::string& key) {
  Names names;
  std::vector<StageSpec> stages;
  for (const YamlValue& entry : YamlValue::expanded(list_at(root, key))) {
    for (const char* needed : {"name", "type"})
      if (!entry.has(needed)) entry.fail(fmt::format("lacks the key '{}'", needed));
    stages.push_back({entry.at("name").name(), entry.at("type").name(), read_settings(entry, {"name", "type"})});
    add_unique(names, entry, stages.back().name);
  }
  return stages;
}

// The value of a measured input, and what moves it: at `value` of the entry, and `moves`.
void read_level(const YamlValue& entry, const Channel& channel, InputLevel& level) {
  level.value = value_of(entry.at("value"), channel);
  if (!entry.has("moves")) return;
  const YamlValue moves = entry.at("moves");
  if (!moves.has("shape")) moves.fail("lacks the key 'shape'");
  level.shape = moves.at("shape").name();
  level.settings = read_settings(moves, {"shape"});
  make_excitation(level.shape, level.settings, 1);
}

// What a controller follows.
void read_set_points(const YamlValue& entry, const std::vector<std::string>& controllers, Profile& profile) {
  profile.controller = entry.at("controller").name();
  if (std::find(controllers.begin(), controllers.end(), profile.controller) == controllers.end())
    entry.at("controller")
        .fail(fmt::format("is '{}'; controllers are {}{}", profile.controller, joined(controllers),
                          did_you_mean(profile.controller, controllers)));
  profile.shape = entry.at("shape").name();
  profile.settings = read_settings(entry, {"name", "controller", "shape", "duration", "meaning", "second", "inputs"});
  make_excitation(profile.shape, profile.settings, 1);  // refuses what the shape does not know
  if (!entry.has("second")) return;
  const YamlValue second = entry.at("second");
  if (!second.has("shape")) second.fail("lacks the key 'shape'");
  profile.second_shape = second.at("shape").name();
  profile.second_settings = read_settings(second, {"shape"});
  make_excitation(profile.second_shape, profile.second_settings, 1);
}

// What drives the commands in an open loop.
void read_driven(const YamlValue& entry, const Datasheet& sheet, Profile& profile) {
  entry.allow({"name", "duration", "meaning", "commands"}, {"inputs"});
  for (const YamlValue& command : entry.at("commands").entries()) {
    if (channel_named(sheet, command, command.key()).role != Role::command)
      command.fail("is not a channel of role command");
    if (!command.has("shape")) command.fail("lacks the key 'shape'");
    profile.commands.push_back({command.key(), command.at("shape").name(), read_settings(command, {"shape"})});
    make_excitation(profile.commands.back().shape, profile.commands.back().settings, 1);
  }
  if (profile.commands.empty()) entry.at("commands").fail("must drive at least one command");
}

}  // namespace

void read_excitation(const YamlValue& root, Datasheet& sheet) {
  for (const YamlValue& entry : mapping_at(root, "inputs")) {
    entry.allow({"value", "wander_std"},
                {"wander_low", "wander_high", "moves", "lag", "lags", "droop", "droop_lag", "meaning"});
    InputSignal input;
    input.channel = entry.key();
    const Channel& channel = channel_named(sheet, entry, input.channel);
    if (channel.role != Role::input) entry.fail("is not a channel of role input");
    read_level(entry, channel, input.level);
    for (const auto& [key, needed] : {std::pair{"lags", "lag"}, std::pair{"droop_lag", "droop"}})
      if (entry.has(key) && !entry.has(needed)) entry.at(key).fail(fmt::format("needs '{}' beside it", needed));
    if (entry.has("lag")) {
      input.lag = entry.at("lag").number(1e-9);
      input.lags = entry.has("lags") ? static_cast<int>(entry.at("lags").number(1, 100)) : 1;
    }
    if (entry.has("droop")) {
      input.droop = entry.at("droop").number(0);
      if (!entry.has("droop_lag")) entry.fail("lacks the key 'droop_lag'");
      input.droop_lag = entry.at("droop_lag").number(0);
    }
    input.wander_std = entry.at("wander_std").number(0);
    if (entry.has("wander_low")) input.wander_low = entry.at("wander_low").number(1e-6);
    if (entry.has("wander_high")) input.wander_high = entry.at("wander_high").number();
    if (input.wander_high <= input.wander_low)
      (entry.has("wander_high") ? entry.at("wander_high") : entry)
          .fail(fmt::format("has wander_high {:g} that is not above wander_low {:g}", input.wander_high,
                            input.wander_low));
    text_or(entry, "meaning", "");
    sheet.inputs.push_back(input);
  }
  Names names, controllers;
  for (const YamlValue& entry : mapping_at(root, "controllers")) {
    text_or(entry, "meaning", "");
    if (!is_name(entry.key())) entry.fail("is not a name of lower-case letters, digits and _");
    controllers.insert(entry.key());
    sheet.controllers[entry.key()] = read_settings(entry, {"meaning"});
  }
  for (const YamlValue& entry : list_at(root, "profiles")) {
    const bool open_loop = entry.has("commands");
    for (const char* key : {"name", "duration", "meaning"})
      if (!entry.has(key)) entry.fail(fmt::format("lacks the key '{}'", key));
    for (const char* key : {"controller", "shape"})
      if (entry.has(key) == open_loop)
        entry.fail(open_loop
                       ? fmt::format("has 'commands', which are driven without a controller: '{}' is too much", key)
                       : fmt::format("lacks the key '{}', or 'commands' that are driven without a controller", key));
    Profile profile;
    profile.name = entry.at("name").name();
    profile.duration = entry.at("duration").number(1e-3);
    profile.meaning = entry.at("meaning").text();
    if (open_loop)
      read_driven(entry, sheet, profile);
    else
      read_set_points(entry, list_of(controllers), profile);
    for (const YamlValue& input : mapping_at(entry, "inputs")) {
      const Channel& channel = channel_named(sheet, input, input.key());
      if (channel.role != Role::input) input.fail("is not a channel of role input");
      InputLevel& level = profile.inputs[input.key()];
      if (!input.is_mapping()) {  // elsewhere, but as ever
        for (const InputSignal& usual : sheet.inputs)
          if (usual.channel == channel.name) level = usual.level;
        level.value = value_of(input, channel);
      } else {
        input.allow({"value"}, {"moves"});
        read_level(input, channel, level);
      }
    }
    add_unique(names, entry, profile.name);
    sheet.profiles.push_back(profile);
  }
}

void read_faults(const YamlValue& root, Datasheet& sheet) {
  Names names;
  for (const YamlValue& entry : list_at(root, "faults")) {
    entry.allow({"name", "meaning"}, {"effects", "commands", "profile"});
    Fault fault;
    fault.name = entry.at("name").name();
    fault.meaning = entry.at("meaning").text();
    fault.effects = read_effects(entry, "effects", sheet);
    for (const YamlValue& command : mapping_at(entry, "commands"))
      fault.commands.push_back(read_command(command, sheet));
    if (fault.effects.empty() && fault.commands.empty()) entry.fail("needs 'effects' or 'commands'");
    if (entry.has("profile")) {
      fault.profile = entry.at("profile").name();
      Names known;
      for (const Profile& profile : sheet.profiles) known.insert(profile.name);
      if (known.count(fault.profile) == 0)
        entry.at("profile").fail(fmt::format("is '{}'; profiles are {}{}", fault.profile, joined(list_of(known)),
                                             did_you_mean(fault.profile, list_of(known))));
    }
    add_unique(names, entry, fault.name);
    sheet.faults.push_back(fault);
  }
  sheet.nuisance = read_effects(root, "nuisance", sheet);
  sheet.nominal_effects = read_effects(root, "nominal_effects", sheet, Sizes::as_the_effect_allows);
}

void read_diagnosis(const YamlValue& root, Datasheet& sheet) {
  sheet.estimators = read_stages(root, "estimators");
  sheet.detectors = read_stages(root, "detectors");
  sheet.isolators = read_stages(root, "isolators");
  if (root.has("segment")) {
    sheet.segment = root.at("segment").number(0);
    if (sheet.segment < 4 * sheet.sample_period)
      root.at("segment").fail(
          fmt::format("is {:g} s; give at least 4 sample periods, {:g} s", sheet.segment, 4 * sheet.sample_period));
  }
  for (const YamlValue& entry : mapping_at(root, "normal_gap")) {
    channel_named(sheet, entry, entry.key());
    sheet.normal_gap[entry.key()] = entry.number(0);
  }
}

}  // namespace faultline::datasheet_sections

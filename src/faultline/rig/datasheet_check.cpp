#include "faultline/rig/datasheet_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "faultline/rig/controller.h"
#include "faultline/rig/nearest_name.h"
#include "faultline/rig/rig.h"
#include "faultline/rig/yaml_reader.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

using Names = std::vector<std::string>;

bool is_signal(const Port& port) { return port.kind == PortKind::command || port.kind == PortKind::sensor; }

template <class T>
bool has(const std::vector<T>& things, const std::string& name) {
  return std::any_of(things.begin(), things.end(), [&](const T& thing) { return thing.name == name; });
}

// What was asked for, as "ports.force.piston".
using Asked = std::set<std::string>;

bool asks(const Asked& asked, const std::string& section, const std::string& name) {
  return asked.count(section + "." + name) > 0;
}

Names asked_of(const Asked& asked, const std::string& section) {
  Names names;
  for (const std::string& entry : asked)
    if (entry.compare(0, section.size() + 1, section + ".") == 0) names.push_back(entry.substr(section.size() + 1));
  return names;
}

template <class T>
bool add_missing(std::vector<T>& things, const Names& asked) {
  const std::size_t before = things.size();
  for (const std::string& name : asked) {
    if (has(things, name)) continue;
    things.emplace_back();
    things.back().name = name;
  }
  return things.size() > before;
}

constexpr int kMostMadeUp = 50;  // of these the first is told anyway

// What `make` looks up in the datasheet. A name that is not there is made up and `make` begins again, so that all are
// known.
template <class Make>
Asked what_it_asks(const Datasheet& sheet, Make&& make) {
  Datasheet watched = sheet;
  watched.asked = std::make_shared<Asked>();
  for (int made_up = 0; made_up < kMostMadeUp; ++made_up) {
    try {
      make(watched);
      break;
    } catch (const InputError&) {
      const bool channels = add_missing(watched.channels, asked_of(*watched.asked, "channels"));
      const bool parameters = add_missing(watched.parameters, asked_of(*watched.asked, "parameters"));
      const bool ports = add_missing(watched.ports, asked_of(*watched.asked, "ports"));
      if (!channels && !parameters && !ports) throw;
    }
  }
  return *watched.asked;
}

// What was asked for and is not listed: told at the entry that was probably meant, one that nobody asked for, else at
// the section.
template <class T>
void check_nothing_lacks(const Datasheet& sheet, const Asked& asked, const std::string& section, const char* what,
                         const std::vector<T>& things) {
  Names unasked;
  for (const T& thing : things)
    if (!asks(asked, section, thing.name)) unasked.push_back(thing.name);
  for (const std::string& name : asked_of(asked, section)) {
    if (has(things, name)) continue;
    const std::string meant = nearest_name(name, unasked);
    if (meant.empty())
      throw InputError(fmt::format("{} lacks the {} '{}', which the equations or controllers of {} ask for",
                                   sheet.place(section), what, name, sheet.rig));
    throw InputError(
        fmt::format("{} is called '{}', a {} that nothing of {} asks for, while '{}' is missing; did you mean '{}'?",
                    sheet.place(section + "." + meant), meant, what, sheet.rig, name, name));
  }
}

void check_ports(const Datasheet& sheet, const Asked& asked) {
  for (const Port& port : sheet.ports)
    if (!is_signal(port) && !asks(asked, "ports", port.name))
      throw InputError(
          fmt::format("{} is a port that the equations of {} never ask for: an effect there would do nothing; they ask "
                      "for {}; take the port out",
                      sheet.place("ports." + port.name), sheet.rig, joined(asked_of(asked, "ports"))));
}

void check_channels(const Datasheet& sheet, const Asked& asked) {
  for (const Channel& channel : sheet.channels)
    if ((channel.role == Role::output || channel.role == Role::command) && !asks(asked, "channels", channel.name))
      throw InputError(fmt::format(
          "{} is '{}', a channel of role {} that the equations of {} never ask for; {}",
          sheet.place("channels." + channel.name), channel.name, to_string(channel.role), sheet.rig,
          channel.role == Role::output ? "what is measured and not predicted has the role input" : "take it out"));
}

// Where runs are simulated, what drives the equations needs a value.
void check_inputs(const Datasheet& sheet, const Asked& asked) {
  for (const Channel& channel : sheet.channels) {
    if (sheet.profiles.empty() || channel.role != Role::input || !channel.predicted_by.empty()) continue;
    const bool given = std::any_of(sheet.inputs.begin(), sheet.inputs.end(),
                                   [&](const InputSignal& input) { return input.channel == channel.name; });
    if (!given && asks(asked, "channels", channel.name))
      throw InputError(
          fmt::format("{} is '{}', which drives the equations and has no entry under 'inputs': it would be 0 "
                      "in every simulated run",
                      sheet.place("channels." + channel.name), channel.name));
  }
}

void check_parameters(const Datasheet& sheet, const Asked& asked) {
  for (const Parameter& parameter : sheet.parameters)
    if ((parameter.tolerance > 0 || parameter.identify) && !asks(asked, "parameters", parameter.name))
      throw InputError(
          fmt::format("{} is '{}', a parameter that the equations of {} never ask for; take it out, or set its "
                      "tolerance to 0 and leave 'identify' out where it serves people only",
                      sheet.place("parameters." + parameter.name), parameter.name, sheet.rig));
}

// `rig` without effects: its states are the datasheet's, and outputs() copies those that a channel measures.
void check_states(const Datasheet& sheet, Rig& rig) {
  const std::size_t count = sheet.states.size();
  if (rig.states() != static_cast<int>(count))
    throw InputError(
        fmt::format("{} are {}; the equations of {} have {}", sheet.place("states"), count, sheet.rig, rig.states()));
  std::vector<double> nominal(count), state(count), channels(sheet.channels.size());
  for (const double scale : {1.0, 2.0}) {
    for (std::size_t i = 0; i < count; ++i) nominal[i] = scale * static_cast<double>(i + 1);
    rig.start_at(nominal.data(), channels.data(), state.data());
    rig.outputs(0, state.data(), channels.data());
    for (std::size_t i = 0; i < count; ++i) {
      const int channel = sheet.states[i].channel;
      if (channel >= 0 && !(std::abs(channels[static_cast<std::size_t>(channel)] - state[i]) <= 1e-9 * state[i]))
        throw InputError(
            fmt::format("{} is said to be measured by '{}', but in the equations of {} that channel shows "
                        "something else; take 'measured_by' out",
                        sheet.place("states." + sheet.states[i].name),
                        sheet.channels[static_cast<std::size_t>(channel)].name, sheet.rig));
    }
  }
}

void check_controllers(const Datasheet& sheet) {
  Names known;
  const std::string of_rig = sheet.rig + "/";
  for (const ControllerType& type : registry<ControllerType>().all())
    if (type.name.rfind(of_rig, 0) == 0) known.push_back(type.name.substr(of_rig.size()));
  for (const auto& [name, settings] : sheet.controllers)
    if (std::find(known.begin(), known.end(), name) == known.end())
      throw InputError(fmt::format("{} is a controller that this build does not have for {}; there are {}{}",
                                   settings.where(), sheet.rig, joined(known), did_you_mean(name, known)));
}

// What a detector claims (settings `effect` and `port`).
void check_claims(const Datasheet& sheet) {
  for (const StageSpec& stage : sheet.detectors) {
    const Settings settings = stage.settings;  // a copy: looking here is no use of a setting
    const std::string port = settings.word_or("port", ""), effect = settings.word_or("effect", "");
    Names ports;
    for (const Port& one : sheet.ports) ports.push_back(one.name);
    if (!port.empty() && std::find(ports.begin(), ports.end(), port) == ports.end())
      throw InputError(fmt::format("{}: 'port' is '{}', which {} does not have; ports are {}{}", settings.where(), port,
                                   sheet.rig, joined(ports), did_you_mean(port, ports)));
    const EffectType* type = find_effect_type(effect);
    Names effects;
    for (const EffectType& one : effect_types()) effects.push_back(one.name);
    if (!effect.empty() && !type)
      throw InputError(fmt::format("{}: 'effect' is '{}', which is none; known are {}{}", settings.where(), effect,
                                   joined(effects), did_you_mean(effect, effects)));
    if (type && !port.empty() && !type->fits_kind(port_kind(port)))
      throw InputError(
          fmt::format("{}: 'effect' is '{}', which does not fit the port {}", settings.where(), effect, port));
  }
}

}  // namespace

void check_datasheet(const Datasheet& sheet) {
  check_claims(sheet);
  const RigType* type = find_rig_type(sheet.rig);
  if (!type) return;
  check_controllers(sheet);
  Asked by_equations = what_it_asks(sheet, [&](const Datasheet& watched) {
    const EffectSet none(watched, {}, watched.sample_period, 0);
    type->make(watched, watched.nominal(), none);
  });
  for (const Channel& channel : sheet.channels)  // the simulator asks for it
    if (!channel.predicted_by.empty()) by_equations.insert("channels." + channel.predicted_by);
  const Asked by_controllers = what_it_asks(sheet, [&](const Datasheet& watched) {
    for (const Profile& profile : watched.profiles) make_controller(watched, profile, 1);
  });
  Asked by_all = by_equations;
  by_all.insert(by_controllers.begin(), by_controllers.end());
  check_nothing_lacks(sheet, by_all, "ports", "port", sheet.ports);
  check_nothing_lacks(sheet, by_all, "channels", "channel", sheet.channels);
  check_nothing_lacks(sheet, by_all, "parameters", "parameter", sheet.parameters);
  check_ports(sheet, by_equations);
  check_channels(sheet, by_equations);
  check_inputs(sheet, by_equations);
  check_parameters(sheet, by_equations);
  const EffectSet none(sheet, {}, sheet.sample_period, 0);
  check_states(sheet, *type->make(sheet, sheet.nominal(), none));
}

}  // namespace faultline

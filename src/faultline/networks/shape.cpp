#include "faultline/networks/shape.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "faultline/signal/error.h"
#include "faultline/signal/text.h"

namespace faultline {
namespace {

constexpr double kMostHidden = 200, kMostLags = 50;
constexpr const char* kSmooth = ".smooth";
constexpr const char* kRate = ".rate";

bool take_ending(std::string& name, const std::string& ending) {
  if (name.size() <= ending.size() || name.compare(name.size() - ending.size(), ending.size(), ending) != 0)
    return false;
  name.resize(name.size() - ending.size());
  return true;
}

std::size_t channel_of(const Datasheet& sheet, const Settings& settings, const std::string& key,
                       const std::string& name) {
  const int channel = find_channel(sheet.channels, name);
  if (channel < 0)
    throw InputError(
        fmt::format("{}: '{}' names '{}', which is no channel of {}", settings.where(), key, name, sheet.rig));
  if (sheet.channels[static_cast<std::size_t>(channel)].ground_truth)
    throw InputError(fmt::format("{}: '{}' names '{}', which is a simulator's only", settings.where(), key, name));
  return static_cast<std::size_t>(channel);
}

std::vector<std::string> names_of(const Settings& settings, const std::string& key) {
  const std::vector<std::string> names = split_words(settings.word(key));
  if (names.empty()) throw InputError(fmt::format("{}: '{}' names nothing", settings.where(), key));
  return names;
}

template <class Named>
std::size_t place_of(const std::vector<Named>& all, const std::string& name) {
  return static_cast<std::size_t>(std::find_if(all.begin(), all.end(), [&](const Named& n) { return n.name == name; }) -
                                  all.begin());
}

std::vector<Tap> taps_of(const NetworkShape& shape, const Settings& settings, const std::string& key) {
  std::vector<Tap> taps;
  for (const std::string& name : names_of(settings, key)) {
    const std::size_t input = place_of(shape.inputs, name), output = place_of(shape.outputs, name);
    if (input < shape.inputs.size())
      taps.push_back({false, input, 0});
    else if (output < shape.outputs.size())
      taps.push_back({true, output, 1});
    else
      throw InputError(fmt::format("{}: '{}' names '{}', which is neither in 'inputs' nor in 'outputs'",
                                   settings.where(), key, name));
  }
  return taps;
}

NetworkUnit black_box(const NetworkShape& shape, std::size_t lags) {
  NetworkUnit unit;
  for (std::size_t i = 0; i < shape.inputs.size(); ++i)
    for (std::size_t lag = 0; lag < lags; ++lag) unit.beside.push_back({false, i, lag});
  for (std::size_t o = 0; o < shape.outputs.size(); ++o) {
    unit.outputs.push_back(o);
    for (std::size_t lag = 1; lag <= lags; ++lag) unit.beside.push_back({true, o, lag});
  }
  return unit;
}

std::string name_of(const NetworkShape& shape, const Tap& tap) {
  const std::string& name = tap.output ? shape.outputs[tap.signal].name : shape.inputs[tap.signal].name;
  return fmt::format("{}-{}", name, tap.lag);
}

}  // namespace

Feedback feedback_of(const std::string& word, const std::string& where) {
  if (word == "none") return Feedback::none;
  if (word == "own") return Feedback::own;
  if (word == "all") return Feedback::all;
  throw InputError(fmt::format("{}: 'feedback' is '{}'; it is none, own or all", where, word));
}

std::size_t NetworkShape::weights() const {
  std::size_t count = 0;
  for (const NetworkUnit& unit : units) count += unit.weights();
  return count;
}

std::size_t NetworkShape::lags() const {
  std::size_t most = 1;
  for (const NetworkUnit& unit : units)
    for (const auto* taps : {&unit.sum, &unit.beside})
      for (const Tap& tap : *taps) most = std::max(most, tap.lag);
  return most;
}

std::vector<std::string> NetworkShape::weight_names() const {
  std::vector<std::string> names;
  for (const NetworkUnit& unit : units) {
    const std::string head = outputs[unit.outputs.front()].name;
    for (const Tap& tap : unit.sum) names.push_back(fmt::format("{}.sum.{}", head, name_of(*this, tap)));
    std::vector<std::string> entries;
    if (!unit.sum.empty()) entries.emplace_back("sum");
    for (const Tap& tap : unit.beside) entries.push_back(name_of(*this, tap));
    for (std::size_t j = 0; j < unit.hidden; ++j)
      for (const std::string& entry : entries) names.push_back(fmt::format("{}.{}.{}", head, j, entry));
    for (std::size_t j = 0; j < unit.hidden; ++j) names.push_back(fmt::format("{}.{}.bias", head, j));
    for (const std::size_t o : unit.outputs) {
      for (std::size_t j = 0; j < unit.hidden; ++j) names.push_back(fmt::format("{}.from.{}", outputs[o].name, j));
      if (!unit.integrating) names.push_back(outputs[o].name + ".bias");
    }
  }
  return names;
}

NetworkShape network_shape(const Datasheet& sheet, const Settings& settings) {
  NetworkShape shape;
  shape.period = sheet.sample_period;
  bool filtered = false;
  for (const std::string& name : names_of(settings, "inputs")) {
    NetworkInput input;
    std::string channel = name;
    if (take_ending(channel, kSmooth))
      input.kind = NetworkInput::Kind::smooth;
    else if (take_ending(channel, kRate))
      input.kind = NetworkInput::Kind::rate;
    filtered = filtered || input.kind != NetworkInput::Kind::plain;
    input.name = name;
    input.channel = channel_of(sheet, settings, "inputs", channel);
    shape.inputs.push_back(input);
  }
  if (filtered) shape.cut_off = settings.number("cut_off", 1e-9 / shape.period, 0.49 / shape.period);
  for (const std::string& name : names_of(settings, "outputs"))
    shape.outputs.push_back({name, channel_of(sheet, settings, "outputs", name)});
  shape.feedback = feedback_of(settings.word("feedback"), settings.where());
  const auto hidden = static_cast<std::size_t>(std::lround(settings.number("hidden", 1, kMostHidden)));
  if (settings.has("lags")) {
    shape.units.push_back(
        black_box(shape, static_cast<std::size_t>(std::lround(settings.number("lags", 1, kMostLags)))));
    shape.units.back().hidden = hidden;
    return shape;
  }
  for (std::size_t o = 0; o < shape.outputs.size(); ++o) {
    const std::string& name = shape.outputs[o].name;
    NetworkUnit unit;
    unit.outputs = {o};
    unit.sum = taps_of(shape, settings, name + "_sum");
    unit.beside = taps_of(shape, settings, name + "_beside");
    unit.hidden = hidden;
    unit.integrating = true;
    unit.gain = settings.number_or(name + "_gain", 1, 1e-9, 1e9);
    shape.units.push_back(unit);
  }
  return shape;
}

}  // namespace faultline

#include "faultline/rig/simulator.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "faultline/numerics/random.h"
#include "faultline/rig/input_source.h"
#include "faultline/rig/running_plant.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr int kSettlings = 4;  // rounds in which a supply that droops and the flow from it agree

double table_value(const CommandTable& table, double time) {
  const auto after = std::upper_bound(table.time.begin(), table.time.end(), time);
  if (after == table.time.begin()) return table.value.front();
  if (after == table.time.end()) return table.value.back();
  const auto i = static_cast<std::size_t>(after - table.time.begin());
  const double share = (time - table.time[i - 1]) / (table.time[i] - table.time[i - 1]);
  return table.value[i - 1] + share * (table.value[i] - table.value[i - 1]);
}

}  // namespace

Random sensor_noise(std::uint64_t seed) { return Random(seed * 104729 + 17); }

double measured_value(const Channel& channel, double value, Random& noise) {
  if (channel.noise_std > 0) value += channel.noise_std * noise.normal();
  if (channel.resolution > 0) value = std::round(value / channel.resolution) * channel.resolution;
  return std::clamp(value, channel.minimum, channel.maximum) + 0.0;  // no negative zero
}

// How often a loop inside the rig runs in a sample period.
int inner_steps(const Datasheet& sheet, const Controller& controller) {
  const double period = controller.inner_period();
  if (!(period > 0)) return 1;
  const double ratio = sheet.sample_period / period;
  if (ratio < 0.5 || std::abs(ratio - std::round(ratio)) > 1e-6)
    throw InputError(fmt::format("{}: the sample period of {:g} s is no multiple of the inner loop's {:g} s", sheet.rig,
                                 sheet.sample_period, period));
  return static_cast<int>(std::llround(ratio));
}

struct Simulator::Parts {
  Parts(const Datasheet& datasheet, const SimulationSetup& given)
      : sheet(datasheet),
        setup(given),
        profile(sheet.profile(setup.profile.empty() ? first_profile() : setup.profile)),
        controller(make_controller(sheet, profile, setup.seed)),
        has_inner(controller->inner_period() > 0),
        parts(inner_steps(sheet, *controller)),
        plant(sheet, setup, Use::simulator, parts) {
    for (const CommandTable& table : setup.commands) {
      const auto channel = static_cast<std::size_t>(sheet.channel(table.channel));
      if (sheet.channels[channel].role != Role::command)
        throw InputError(fmt::format("{}: channel '{}' is not a command", sheet.rig, table.channel));
      tables.push_back({channel, table});
    }
    for (std::size_t i = 0; i < sheet.inputs.size(); ++i) {
      const InputSignal& input = sheet.inputs[i];
      const auto elsewhere = profile.inputs.find(input.channel);
      const InputLevel& level = elsewhere == profile.inputs.end() ? input.level : elsewhere->second;
      sources.push_back({static_cast<std::size_t>(sheet.channel(input.channel)),
                         InputSource(input, level, setup.seed * 7919 + i + 1, sheet.sample_period)});
    }
    const std::size_t n = sheet.channels.size();
    for (std::size_t c = 0; c < n; ++c)
      if (sheet.channels[c].role == Role::command) commands.push_back(c);
    driving.resize(n);
    next.resize(n);
    inside.resize(n);
    mean.resize(n);
    sample.values.resize(n);
    reset();
  }

  std::string first_profile() const {
    if (sheet.profiles.empty()) throw InputError(fmt::format("{}: the datasheet has no profiles", sheet.file));
    return sheet.profiles.front().name;
  }

  // The rig is at rest under the set points and commands of the first row: they are asked for once, with all 0, and
  // kept.
  void reset() {
    std::fill(driving.begin(), driving.end(), 0);
    begin();
    take_row();
    begin();
  }

  void begin() {
    noise = sensor_noise(setup.seed);
    controller->reset();
    row = 0;
    bool droops = false;
    for (auto& [channel, source] : sources) {
      source.settle(0);
      droops |= source.droops();
    }
    for (int i = 0; i < (droops ? kSettlings : 1); ++i) {
      fill_inputs(0, driving.data());
      plant.start(0, driving.data(), nullptr, nullptr, {});
      for (auto& [channel, source] : sources)
        if (source.droops()) source.settle(plant.drawn(static_cast<int>(channel), 0));
    }
  }

  double time_of(std::uint64_t k) const { return static_cast<double>(k) * sheet.sample_period; }

  void fill_inputs(double time, double* channels) {
    for (auto& [channel, source] : sources)
      channels[channel] =
          source.value(time, source.droops() ? plant.drawn(static_cast<int>(channel), time - sheet.sample_period) : 0);
  }

  // A controller sees of such an input what the row before it says.
  bool follows(std::size_t channel) const { return !sheet.channels[channel].predicted_by.empty(); }

  double measured(std::size_t channel, double value) {
    return setup.noise ? measured_value(sheet.channels[channel], value, noise) : value;
  }

  // What acts on the plant; a command's noise is of its recording.
  void apply_commands(double time, double* channels) {
    for (const auto& [channel, table] : tables) channels[channel] = table_value(table, time);
    for (const std::size_t c : commands)
      driving[c] = channels[c] = std::clamp(channels[c], sheet.channels[c].minimum, sheet.channels[c].maximum);
  }
  double recorded(std::size_t command, double value) {
    return sheet.channels[command].noise_std > 0 ? measured(command, value) : value;
  }

  // A row's commands are known when its period is over where a loop inside the rig moves them.
  const Sample& step() {
    if (row > 0 && !has_inner) run_period();
    take_row();
    if (has_inner) run_period();
    return sample;
  }

  void take_row() {
    const double time = time_of(row);
    sample.time = time;
    sample.sequence = row;
    for (std::size_t c = 0; c < sample.values.size(); ++c) {
      const Role role = sheet.channels[c].role;
      if (role == Role::output) sample.values[c] = measured(c, plant.seen()[c]);
      if (role == Role::input && !follows(c)) sample.values[c] = driving[c];
      if (role == Role::setpoint) sample.values[c] = 0;
      if (role == Role::command) sample.values[c] = driving[c];
    }
    for (const auto& [channel, chain] : plant.input_sensors())
      if (!follows(channel)) sample.values[channel] = chain->signal(sample.values[channel], time);
    for (std::size_t c = 0; c < sample.values.size(); ++c)
      if (sheet.channels[c].role == Role::input && !follows(c)) sample.values[c] = measured(c, sample.values[c]);
    controller->step(time, sample.values.data());
    apply_commands(time, sample.values.data());
    for (std::size_t c = 0; c < sample.values.size(); ++c)
      if (sheet.channels[c].role == Role::setpoint) driving[c] = sample.values[c];
    if (!has_inner)
      for (const std::size_t c : commands) sample.values[c] = recorded(c, driving[c]);
    plant.follow(time, driving.data());
    for (std::size_t c = 0; c < sample.values.size(); ++c)
      if (follows(c)) sample.values[c] = measured(c, plant.seen()[c]);
    ++row;
  }

  // From the last row that was taken to the next.
  void run_period() {
    const double before = time_of(row - 1);
    std::copy(driving.begin(), driving.end(), next.begin());
    fill_inputs(time_of(row), next.data());
    std::copy(sample.values.begin(), sample.values.end(), inside.begin());
    std::fill(mean.begin(), mean.end(), 0);
    for (int part = 0; part < parts; ++part) {
      if (has_inner) {
        const double time = before + part * controller->inner_period();
        for (std::size_t c = 0; part > 0 && c < inside.size(); ++c)
          if (sheet.channels[c].role == Role::output) inside[c] = measured(c, plant.seen()[c]);
        controller->inner_step(time, inside.data());
        apply_commands(time, inside.data());
        for (const std::size_t c : commands) mean[c] += driving[c] / parts;
      }
      plant.advance(before, driving.data(), next.data(), part);
    }
    if (has_inner)
      for (const std::size_t c : commands) sample.values[c] = recorded(c, mean[c]);
    for (const auto& [channel, source] : sources) driving[channel] = next[channel];
  }

  const Datasheet sheet;
  const SimulationSetup setup;
  const Profile profile;
  std::unique_ptr<Controller> controller;
  const bool has_inner;
  const int parts;
  RunningPlant plant;
  std::vector<std::size_t> commands;
  std::vector<std::pair<std::size_t, CommandTable>> tables;
  std::vector<std::pair<std::size_t, InputSource>> sources;
  Random noise{0};
  std::uint64_t row = 0;
  std::vector<double> driving, next, inside, mean;
  Sample sample;
};

Simulator::Simulator(const Datasheet& sheet, const SimulationSetup& setup)
    : parts_(std::make_unique<Parts>(sheet, setup)) {}
Simulator::~Simulator() = default;
void Simulator::reset() { parts_->reset(); }
const Sample& Simulator::step() { return parts_->step(); }

Recording simulate(const Datasheet& sheet, const SimulationSetup& setup, double duration) {
  Simulator simulator(sheet, setup);
  Recording recording;
  recording.rig = sheet.rig;
  recording.channels = sheet.channels;
  const auto rows = static_cast<std::size_t>(std::llround(duration / sheet.sample_period)) + 1;
  recording.time.reserve(rows);
  recording.sequence.reserve(rows);
  recording.values.reserve(rows * sheet.channels.size());
  for (std::size_t k = 0; k < rows; ++k) recording.append(simulator.step());
  return recording;
}

std::vector<double> draw_parameters(const Datasheet& sheet, std::uint64_t seed) {
  Random random(seed * 6364136223846793005ULL + 99);
  std::vector<double> values = sheet.nominal();
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] *= 1 + sheet.parameters[i].tolerance * std::clamp(random.normal(), -2.0, 2.0);
  return values;
}

}  // namespace faultline

#include "faultline/rig/simulator.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "faultline/numerics/integrator.h"
#include "faultline/numerics/random.h"
#include "faultline/rig/input_source.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr int kSettlings = 4;  // rounds in which a supply that droops and the flow from it agree

std::vector<EffectSpec> all_effects(const Datasheet& sheet, const std::vector<EffectSpec>& extra) {
  std::vector<EffectSpec> specs = nominal_effects(sheet);
  specs.insert(specs.end(), extra.begin(), extra.end());
  return specs;
}

enum class Use { simulator, model };  // a rig's stand-in, or the model that a recording drives: which substep

double period_of(const Datasheet& sheet, const SimulationSetup& setup) {
  return setup.sample_period > 0 ? setup.sample_period : sheet.sample_period;
}

// A multiple of `parts`.
int substeps_of(const Datasheet& sheet, const SimulationSetup& setup, Use use, int parts = 1) {
  const RigType* type = find_rig_type(sheet.rig);
  double wanted = type ? type->substep : sheet.sample_period;
  const std::vector<EffectSpec> effects = all_effects(sheet, setup.effects);
  const bool faster = std::any_of(effects.begin(), effects.end(), [](const EffectSpec& effect) {
    const PortKind kind = port_kind(effect.port);
    return kind == PortKind::line || kind == PortKind::transmission;
  });
  if (type && use == Use::model && type->model_substep > 0 && !faster) wanted = type->model_substep;
  if (setup.substep > 0) wanted = setup.substep;
  return parts * std::max(1, static_cast<int>(std::ceil(period_of(sheet, setup) / (wanted * parts) - 1e-9)));
}

// What a recording shows of a channel around a row.
using CourseOf = std::function<Shown(std::size_t channel, double later)>;

// A rig with its effects, and the effects on its signals by channel: what driven and closed-loop simulation share.
class Plant {
 public:
  // A sample period may be run in as many `parts`.
  Plant(const Datasheet& sheet, const SimulationSetup& setup, Use use, int parts = 1)
      : sheet_(sheet),
        use_(use),
        period_(period_of(sheet, setup)),
        parts_(parts),
        substeps_(substeps_of(sheet, setup, use, parts)),
        substep_(period_ / substeps_),
        effects_(sheet, all_effects(sheet, setup.effects), substep_, setup.seed, period_) {
    const RigType* type = find_rig_type(sheet.rig);
    if (!type)
      throw InputError(
          fmt::format("{}: this build has the datasheet of '{}' but not its equations", sheet.file, sheet.rig));
    if (!setup.parameters.empty() && setup.parameters.size() != sheet.parameters.size())
      throw InputError(fmt::format("{}: {} parameter values are given, the rig has {}", sheet.rig,
                                   setup.parameters.size(), sheet.parameters.size()));
    rig_ = type->make(sheet, setup.parameters.empty() ? sheet.nominal() : setup.parameters, effects_);
    integrator_ = make_integrator(*rig_);
    for (std::size_t c = 0; c < sheet.channels.size(); ++c) {
      if (sheet.channels[c].predicted_by.empty()) continue;
      const auto command = static_cast<std::size_t>(sheet.channel(sheet.channels[c].predicted_by));
      followers_.push_back({c, command, nullptr, nullptr, std::vector<double>(static_cast<std::size_t>(substeps_))});
    }
    for (const Port& port : sheet.ports) {
      const EffectChain& chain = effects_.at(port.name);
      if (chain.empty() || port.channel.empty()) continue;
      const auto channel = static_cast<std::size_t>(sheet.channel(port.channel));
      bool followed = false;
      for (Follower& f : followers_) {
        if (port.kind == PortKind::sensor && f.input == channel) f.sensor = &chain;
        if (port.kind != PortKind::command || f.command != channel) continue;
        f.drive = &chain;
        followed = true;
      }
      if (port.kind == PortKind::command && !followed) commands_.push_back({channel, &chain});
      if (port.kind == PortKind::sensor && sheet.channels[channel].role == Role::output)
        sensors_.push_back({channel, &chain});
      if (port.kind == PortKind::sensor && sheet.channels[channel].role == Role::input)
        inputs_.push_back({channel, &chain});
    }
    for (std::size_t c = 0; c < sheet.channels.size(); ++c) {
      if (sheet.channels[c].role == Role::input) run_.push_back(c);
      if (sheet.channels[c].role == Role::command) held_.push_back(c);
    }
    for (std::size_t i = 0; i < sheet.states.size(); ++i)
      for (const auto& [channel, chain] : sensors_)
        if (sheet.states[i].channel == static_cast<int>(channel)) shown_states_.push_back({i, chain});
    rest_.resize(static_cast<std::size_t>(rig_->states()));
    moved_.resize(rest_.size());
    start_.resize(sheet.states.size());
    true_.resize(sheet.channels.size());
    shown_.resize(sheet.channels.size());
    resumed_.resize(sheet.channels.size());
  }

  // `channels`: commands and inputs at this time. Afterwards seen() holds what the sensors show.
  void start(double time, const double* channels, const double* nominal_state, const CourseOf& around) {
    effects_.reset();
    effects_.set_time(time);
    std::copy_n(channels, true_.size(), true_.begin());
    for (const auto& [channel, chain] : commands_) true_[channel] = chain->signal(channels[channel], time);
    if (use_ == Use::simulator)
      for (const Follower& f : followers_) true_[f.input] = channels[f.command];
    std::fill_n(integrator_->state(), rig_->states(), 0.0);
    rig_->start(true_.data(), integrator_->state());
    effects_.reset();
    effects_.set_time(time);
    std::fill(resumed_.begin(), resumed_.end(), std::nan(""));
    if (nominal_state) restart(time, channels, nominal_state, around, false);
    rig_->outputs(time, integrator_->state(), shown_.data());
    for (const auto& [channel, chain] : sensors_)
      shown_[channel] = std::isnan(resumed_[channel]) ? chain->signal(shown_[channel], time) : resumed_[channel];
  }

  // Puts the rig's states back; what sensors show at this time stays as it was. A state that is NaN goes on. A state
  // that a channel shows is what that channel says, back through its sensor's effects, which go on from there; other
  // effects keep their memory. `running`: whether the states until now are worth anything.
  void restart(double time, const double* channels, const double* nominal_state, const CourseOf& around, bool running) {
    std::vector<double>& state = start_;
    if (std::all_of(nominal_state, nominal_state + state.size(), [](double v) { return std::isnan(v); })) return;
    for (std::size_t i = 0; i < state.size(); ++i)
      state[i] = std::isnan(nominal_state[i]) ? integrator_->state()[i] : nominal_state[i];
    for (const auto& [index, chain] : shown_states_) {
      if (std::isnan(nominal_state[index])) continue;
      const auto channel = static_cast<std::size_t>(sheet_.states[index].channel);
      const double own = integrator_->state()[index], shown = state[index];
      const double at_now = around ? around(channel, 0).value : 0;
      const Course course = [&, index = index](double later) {
        if (!around) return Shown{shown};
        Shown result = around(channel, later);
        result.value += shown - at_now;
        return result;
      };
      const double value = chain->resume(course, time, running ? own : std::nan("")).value;
      state[index] = std::isnan(value) ? own : value;
      if (!std::isnan(value)) resumed_[channel] = shown;
    }
    move_to(state.data(), channels);
  }

  // What inputs that follow a command do over the period from `time` on: seen() shows their mean, as their sensors do.
  // To be called once per period, before advance().
  void follow(double time, const double* channels) {
    effects_.set_time(time);
    for (Follower& f : followers_) {
      double sum = 0;
      for (int i = 0; i < substeps_; ++i) {
        double& value = f.values[static_cast<std::size_t>(i)];
        value = f.drive ? f.drive->signal(channels[f.command], time + i * substep_) : channels[f.command];
        sum += value;
      }
      const double mean = sum / substeps_;
      shown_[f.input] = f.sensor ? f.sensor->signal(mean, time) : mean;
    }
  }

  // One sample period from `time`, or one part of it: commands held, inputs run linearly from `now` to `next`; one that
  // follows a command has its mean over the period in the period's first row, and is held where a recording gives it.
  void advance(double time, const double* now, const double* next, int part = 0) {
    const int count = substeps_ / parts_;
    effects_.set_time(time + part * count * substep_);
    for (int i = part * count; i < (part + 1) * count; ++i) {
      const double t = time + i * substep_;
      const double share = (i + 0.5) / substeps_;
      for (const std::size_t c : run_) true_[c] = now[c] + share * (next[c] - now[c]);
      for (const std::size_t c : held_) true_[c] = now[c];
      for (const auto& [channel, chain] : commands_) true_[channel] = chain->signal(now[channel], t);
      for (const Follower& f : followers_)
        true_[f.input] = use_ == Use::simulator ? f.values[static_cast<std::size_t>(i)] : now[f.input];
      integrator_->step(t, substep_, true_.data());
      if (i + 1 == (part + 1) * count || !sensors_.empty()) observe(t + substep_);
    }
  }

  const std::vector<double>& seen() const { return shown_; }
  const std::vector<std::pair<std::size_t, const EffectChain*>>& input_sensors() const { return inputs_; }
  const double* state() const { return integrator_->state(); }
  double drawn(int channel, double time) const {
    return rig_->drawn(channel, time, integrator_->state(), true_.data());
  }
  bool remembers() const {
    return effects_.remembers() || static_cast<std::size_t>(rig_->states()) > sheet_.states.size();
  }
  double period() const { return period_; }

 private:
  // What effects add to the state keeps its distance to rest: a load stays at the flank of the play on which it was.
  void move_to(const double* nominal_state, const double* channels) {
    double* state = integrator_->state();
    std::fill(rest_.begin(), rest_.end(), 0);
    std::fill(moved_.begin(), moved_.end(), 0);
    rig_->start_at(state, channels, rest_.data());
    rig_->start_at(nominal_state, channels, moved_.data());
    for (std::size_t i = 0; i < rest_.size(); ++i) state[i] = moved_[i] + (state[i] - rest_[i]);
    rig_->set_modes(state);
  }

  // Outputs as they are, then as sensors with effects show them.
  void observe(double time) {
    rig_->outputs(time, integrator_->state(), shown_.data());
    for (const auto& [channel, chain] : sensors_) shown_[channel] = chain->signal(shown_[channel], time);
  }

  struct Follower {  // an input that the model predicts from a command
    std::size_t input, command;
    const EffectChain *drive, *sensor;  // null: nothing sits there
    std::vector<double> values;         // of the input, per substep of the period
  };

  const Datasheet& sheet_;
  Use use_;
  double period_;  // s
  int parts_, substeps_;
  double substep_;
  EffectSet effects_;
  std::unique_ptr<Rig> rig_;
  std::unique_ptr<Integrator> integrator_;
  std::vector<std::pair<std::size_t, const EffectChain*>> commands_, sensors_, inputs_;
  std::vector<std::pair<std::size_t, const EffectChain*>> shown_states_;
  std::vector<std::size_t> run_, held_;  // channels: inputs, commands
  std::vector<Follower> followers_;
  std::vector<double> true_, shown_, start_, rest_, moved_;
  std::vector<double> resumed_;  // per channel: what its sensor shows at a start; NaN: what its effects make of it
};

double table_value(const CommandTable& table, double time) {
  const auto after = std::upper_bound(table.time.begin(), table.time.end(), time);
  if (after == table.time.begin()) return table.value.front();
  if (after == table.time.end()) return table.value.back();
  const auto i = static_cast<std::size_t>(after - table.time.begin());
  const double share = (time - table.time[i - 1]) / (table.time[i] - table.time[i - 1]);
  return table.value[i - 1] + share * (table.value[i] - table.value[i - 1]);
}

}  // namespace

std::vector<EffectSpec> nominal_effects(const Datasheet& sheet) {
  std::vector<EffectSpec> specs;
  for (const std::string& text : sheet.nominal_effects) specs.push_back(parse_effect(text));
  return specs;
}

int model_substeps(const Datasheet& sheet, const std::vector<EffectSpec>& effects) {
  SimulationSetup setup;
  setup.effects = effects;
  return substeps_of(sheet, setup, Use::model);
}

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
      plant.start(0, driving.data(), nullptr, {});
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
  Plant plant;
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

struct DrivenModel::Parts {
  Parts(std::shared_ptr<const Datasheet> datasheet, const SimulationSetup& setup)
      : sheet(std::move(datasheet)),
        plant(*sheet, setup, Use::model),
        now(sheet->channels.size()),
        next(sheet->channels.size()) {}

  // What reaches the plant: a sensor whose reading drives the model shows the true value through its effects.
  void take(const Recording& recording, std::size_t row, std::vector<double>& values) {
    std::copy_n(recording.row(row), values.size(), values.begin());
    for (const auto& [channel, chain] : plant.input_sensors()) {
      const double at = time(recording, row);
      const double value = look && chain->remembers() ? chain->undo(course(recording, row, channel), at).value
                                                      : chain->undo_signal(values[channel], at);
      if (!std::isnan(value)) values[channel] = value;
    }
  }
  Course course(const Recording& recording, std::size_t row, std::size_t channel) const {
    return [this, &recording, row, c = channel](double later) { return look(recording, row, c, later); };
  }
  static double time(const Recording& recording, std::size_t row) {
    return recording.time[row] - recording.time.front();
  }

  const std::shared_ptr<const Datasheet> sheet;
  // `later` counts from this row.
  CourseOf around(const Recording& recording, std::size_t row) const {
    if (!look) return {};
    return [this, &recording, row](std::size_t channel, double later) { return look(recording, row, channel, later); };
  }

  Plant plant;
  Around look;
  std::vector<double> now, next;
};

DrivenModel::DrivenModel(const Datasheet& sheet, const SimulationSetup& setup)
    : DrivenModel(std::make_shared<const Datasheet>(sheet), setup) {}
DrivenModel::DrivenModel(std::shared_ptr<const Datasheet> sheet, const SimulationSetup& setup)
    : parts_(std::make_unique<Parts>(std::move(sheet), setup)) {}
DrivenModel::~DrivenModel() = default;

void DrivenModel::begin(const Recording& recording, std::size_t row, const double* state) {
  parts_->take(recording, row, parts_->now);
  parts_->plant.start(Parts::time(recording, row), parts_->now.data(), state, parts_->around(recording, row));
  parts_->plant.follow(Parts::time(recording, row), parts_->now.data());
}

bool DrivenModel::remembers() const { return parts_->plant.remembers(); }

void DrivenModel::set_around(Around around) { parts_->look = std::move(around); }

void DrivenModel::advance(const Recording& recording, std::size_t to_row, const double* state) {
  parts_->take(recording, to_row, parts_->next);
  const double time = Parts::time(recording, to_row - 1);
  parts_->plant.advance(time, parts_->now.data(), parts_->next.data());
  parts_->now.swap(parts_->next);
  parts_->plant.follow(time + parts_->plant.period(), parts_->now.data());
  if (state)
    parts_->plant.restart(time + parts_->plant.period(), parts_->now.data(), state, parts_->around(recording, to_row),
                          true);
}

const double* DrivenModel::predicted() const { return parts_->plant.seen().data(); }
const double* DrivenModel::state() const { return parts_->plant.state(); }
std::size_t DrivenModel::state_count() const { return parts_->sheet->states.size(); }

std::vector<double> draw_parameters(const Datasheet& sheet, std::uint64_t seed) {
  Random random(seed * 6364136223846793005ULL + 99);
  std::vector<double> values = sheet.nominal();
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] *= 1 + sheet.parameters[i].tolerance * std::clamp(random.normal(), -2.0, 2.0);
  return values;
}

}  // namespace faultline

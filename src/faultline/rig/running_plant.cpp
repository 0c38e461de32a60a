#include "faultline/rig/running_plant.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "faultline/rig/even_step.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

std::vector<EffectSpec> all_effects(const Datasheet& sheet, const std::vector<EffectSpec>& extra) {
  std::vector<EffectSpec> specs = nominal_effects(sheet);
  specs.insert(specs.end(), extra.begin(), extra.end());
  return specs;
}

double period_of(const Datasheet& sheet, const SimulationSetup& setup) {
  return setup.sample_period > 0 ? setup.sample_period : sheet.sample_period;
}

// Brings states faster than the rig's own.
bool is_fast(const RigType& type, const EffectSpec& effect) {
  if (type.is_fast) return type.is_fast(effect);
  const PortKind kind = port_kind(effect.port);
  return kind == PortKind::line || (kind == PortKind::transmission && effect.effect != "scale");
}

// A hysteretic force and bristles are stiff springs.
bool asks_for_short_steps(const RigType& type, const EffectSpec& effect) {
  return is_fast(type, effect) || (port_kind(effect.port) == PortKind::force &&
                                   (effect.effect == "hysteresis" || effect.effect == "presliding_friction"));
}

// The parameters, and the effects but those at sensors of outputs; empty where a start is read from these.
std::string moved_by(const Datasheet& sheet, const SimulationSetup& setup) {
  if (std::any_of(sheet.states.begin(), sheet.states.end(), [](const State& s) { return s.channel >= 0; })) return {};
  std::string result;
  for (const double value : setup.parameters.empty() ? sheet.nominal() : setup.parameters)
    result += fmt::format("{} ", value);
  for (const EffectSpec& effect : setup.effects) {
    const Port& port = sheet.port(effect.port);
    if (port.kind != PortKind::sensor ||
        sheet.channels[static_cast<std::size_t>(sheet.channel(port.channel))].role != Role::output)
      result += fmt::format("{}@{} {} {} {} {};", effect.effect, effect.port, fmt::join(effect.parameters, " "),
                            effect.from, effect.to, effect.swells);
  }
  return result;
}

// A multiple of `parts`.
int substeps_of(const Datasheet& sheet, const SimulationSetup& setup, Use use, int parts = 1) {
  const RigType* type = find_rig_type(sheet.rig);
  double wanted = type ? type->substep : sheet.sample_period;
  if (type && use == Use::model) {
    const std::vector<EffectSpec> effects = all_effects(sheet, setup.effects);
    const bool faster = std::any_of(effects.begin(), effects.end(),
                                    [type](const EffectSpec& effect) { return is_fast(*type, effect); });
    double coarser = faster ? type->fast_substep : type->model_substep;
    if (faster && setup.rough) coarser = std::max(coarser, type->rough_fast_substep);
    if (coarser > 0) wanted = coarser;
  }
  if (setup.substep > 0) wanted = setup.substep;
  return parts * std::max(1, static_cast<int>(std::ceil(period_of(sheet, setup) / (wanted * parts) - 1e-9)));
}

}  // namespace

RunningPlant::RunningPlant(const Datasheet& sheet, const SimulationSetup& setup, Use use, int parts)
    : sheet_(sheet),
      use_(use),
      period_(period_of(sheet, setup)),
      parts_(parts),
      substeps_(substeps_of(sheet, setup, use, parts)),
      substep_(period_ / substeps_),
      effects_(sheet, all_effects(sheet, setup.effects), substep_, setup.seed, period_),
      beside_(setup.beside),
      moved_by_(moved_by(sheet, setup)) {
  const RigType* type = find_rig_type(sheet.rig);
  if (!type)
    throw InputError(
        fmt::format("{}: this build has the datasheet of '{}' but not its equations", sheet.file, sheet.rig));
  if (!setup.parameters.empty() && setup.parameters.size() != sheet.parameters.size())
    throw InputError(fmt::format("{}: {} parameter values are given, the rig has {}", sheet.rig,
                                 setup.parameters.size(), sheet.parameters.size()));
  rig_ = type->make(sheet, setup.parameters.empty() ? sheet.nominal() : setup.parameters, effects_);
  integrator_ = make_integrator(*rig_);
  before_.resize(static_cast<std::size_t>(rig_->states()));
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
    if (port.kind == PortKind::command && !followed)
      commands_.push_back({channel, &chain, std::vector<double>(static_cast<std::size_t>(substeps_))});
    if (port.kind == PortKind::sensor && sheet.channels[channel].role == Role::output)
      sensors_.push_back({channel, &chain, chain.remembers(), 0});
    if (port.kind == PortKind::sensor && sheet.channels[channel].role == Role::input)
      inputs_.push_back({channel, &chain});
  }
  for (std::size_t c = 0; c < sheet.channels.size(); ++c) {
    if (sheet.channels[c].role == Role::input) run_.push_back(c);
    if (sheet.channels[c].role == Role::command) held_.push_back(c);
  }
  for (std::size_t i = 0; i < sheet.states.size(); ++i)
    for (const Sensor& sensor : sensors_)
      if (sheet.states[i].channel == static_cast<int>(sensor.channel)) shown_states_.push_back({i, sensor.chain});
  if (setup.long_steps && use == Use::model && setup.substep <= 0 && parts == 1)
    even_ = longest_even_step(*type, setup);
  rest_.resize(static_cast<std::size_t>(rig_->states()));
  moved_.resize(rest_.size());
  start_.resize(sheet.states.size());
  true_.resize(sheet.channels.size());
  shown_.resize(sheet.channels.size());
  resumed_.resize(sheet.channels.size());
  plain_.resize(sheet.channels.size());
}

// What shows is asked after a step for each of its substeps; what acts in the equations would have to be asked within.
int RunningPlant::longest_even_step(const RigType& type, const SimulationSetup& setup) const {
  const std::vector<EffectSpec> specs = all_effects(sheet_, setup.effects);
  if (effects_.remembers_inside() || std::any_of(specs.begin(), specs.end(), [&type](const EffectSpec& effect) {
        return asks_for_short_steps(type, effect);
      }))
    return 1;
  return std::clamp(static_cast<int>(type.even_substep / substep_ + 1e-9), 1, substeps_);
}

void RunningPlant::start(double time, const double* channels, const double* nominal_state, const double* hidden,
                         const CourseOf& around) {
  effects_.reset();
  effects_.set_time(time);
  std::copy_n(channels, true_.size(), true_.begin());
  for (const Command& c : commands_) true_[c.channel] = c.chain->signal(channels[c.channel], time);
  if (use_ == Use::simulator)
    for (const Follower& f : followers_) true_[f.input] = channels[f.command];
  std::fill_n(integrator_->state(), rig_->states(), 0.0);
  try {
    rig_->start(true_.data(), integrator_->state());
    if (use_ == Use::model)
      rig_->start_as_shown([&](int channel) { return shown_at_start(channel, time, channels, around); },
                           integrator_->state());
  } catch (const InputError&) {
    // A model that is tried need not have a state of rest: where states are measured it begins from those, and from
    // where the others came to.
    if (!nominal_state) throw;
  }
  effects_.reset();
  effects_.set_time(time);
  std::fill(resumed_.begin(), resumed_.end(), std::nan(""));
  if (nominal_state) restart(time, channels, nominal_state, hidden, around, false);
  rig_->outputs(time, integrator_->state(), shown_.data());
  for (Sensor& sensor : sensors_) {
    const double resumed = resumed_[sensor.channel];
    sensor.before = shown_[sensor.channel];
    shown_[sensor.channel] = std::isnan(resumed) ? sensor.chain->signal(sensor.before, time) : resumed;
  }
}

double RunningPlant::shown_at_start(int channel, double time, const double* channels, const CourseOf& around) const {
  const auto c = static_cast<std::size_t>(channel);
  const Course course = [&](double later) { return around ? around(c, later) : Shown{channels[c]}; };
  const auto at = std::find_if(sensors_.begin(), sensors_.end(), [c](const Sensor& s) { return s.channel == c; });
  return at == sensors_.end() ? course(0).value : at->chain->undo(course, time).value;
}

void RunningPlant::remember(std::size_t command, double value, double time) {
  for (const Command& c : commands_)
    if (c.channel == command) c.chain->signal(value, time);
  for (const Follower& f : followers_)
    if (f.command == command && f.drive) f.drive->signal(value, time);
}

double RunningPlant::within_reading(std::size_t state, const double* channels) const {
  const double own = integrator_->state()[state];
  const int channel = sheet_.states[state].channel;
  const auto shows_it = [channel](const Sensor& sensor) { return static_cast<int>(sensor.channel) == channel; };
  if (channel < 0 || std::any_of(sensors_.begin(), sensors_.end(), shows_it)) return own;
  const Channel& shown = sheet_.channels[static_cast<std::size_t>(channel)];
  const double reading = shown.ground_truth ? std::nan("") : channels[channel];
  return reading <= shown.minimum   ? std::min(own, shown.minimum)
         : reading >= shown.maximum ? std::max(own, shown.maximum)
                                    : own;
}

void RunningPlant::restart(double time, const double* channels, const double* nominal_state, const double* hidden,
                           const CourseOf& around, bool running) {
  std::vector<double>& state = start_;
  if (std::all_of(nominal_state, nominal_state + state.size(), [](double v) { return std::isnan(v); })) return;
  for (std::size_t i = 0; i < state.size(); ++i)
    state[i] = std::isnan(nominal_state[i]) ? within_reading(i, channels) : nominal_state[i];
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
    const double known = hidden ? hidden[index] : std::nan("");
    const double value = chain->resume(course, time, running ? own : std::nan(""), known).value;
    state[index] = std::isnan(value) ? own : value;
    if (!std::isnan(value)) resumed_[channel] = shown;
  }
  move_to(state.data(), channels, hidden ? hidden + state.size() : nullptr);
  if (even_ == 1) return;
  rig_->outputs(time, integrator_->state(), plain_.data());
  for (Sensor& sensor : sensors_) sensor.before = plain_[sensor.channel];
}

void RunningPlant::follow(double time, const double* channels) {
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

void RunningPlant::advance(double time, const double* now, const double* next, int part) {
  const int count = substeps_ / parts_;
  effects_.set_time(time + part * count * substep_);
  take_commands(time, now, part * count, (part + 1) * count);
  take_steps(time, now, next, part * count, (part + 1) * count);
}

void RunningPlant::take_commands(double time, const double* now, int first, int last) {
  for (Command& c : commands_)
    for (int i = first; i < last; ++i)
      c.values[static_cast<std::size_t>(i)] = c.chain->signal(now[c.channel], time + i * substep_);
}

void RunningPlant::take_steps(double time, const double* now, const double* next, int first, int last) {
  for (int i = first; i < last;) {
    const int count = take_step(time, now, next, i, last);
    i += count;
    if (i == substeps_ || !sensors_.empty() || (i == last && parts_ > 1)) observe(time + i * substep_, count);
  }
}

int RunningPlant::take_step(double time, const double* now, const double* next, int first, int last) {
  if (even_ > 1 && first + even_ <= last && step_evenly(time, now, next, first)) return even_;
  step(time, now, next, first, 1);
  return 1;
}

bool RunningPlant::goes_beside(const RunningPlant& leader) const {
  const auto own_states = [](const RunningPlant& plant) {
    return static_cast<std::size_t>(plant.rig_->states()) > plant.sheet_.states.size();
  };
  return (rig_->stiff() || (beside_ && even_ > 1)) && leader.even_ == even_ && parts_ == 1 &&
         leader.substeps_ == substeps_ && !effects_.remembers_inside() && !leader.effects_.remembers_inside() &&
         !own_states(*this) && !own_states(leader);
}

bool RunningPlant::moves_as(const RunningPlant& leader) const {
  return !moved_by_.empty() && moved_by_ == leader.moved_by_;
}

void RunningPlant::advance(double time, const double* now, const double* next, const std::vector<Beside>& beside) {
  effects_.set_time(time);
  take_commands(time, now, 0, substeps_);
  for (const Beside& other : beside) {
    other.plant->effects_.set_time(time);
    other.plant->take_commands(time, other.now, 0, substeps_);
  }
  const bool led = std::any_of(beside.begin(), beside.end(), [](const Beside& other) { return !other.alike; });
  for (int i = 0; i < substeps_;) {
    const int motion = rig_->motion(integrator_->state());
    const int count = take_step(time, now, next, i, substeps_), end = i + count;
    // An explicit method meets its events in the shorter steps, and what leads has none.
    const bool leads = led && (rig_->stiff() || count == even_) &&
                       integrator_->lead(time + i * substep_, count * substep_, true_.data());
    if (end == substeps_ || !sensors_.empty()) observe(time + end * substep_, count);
    for (const Beside& other : beside) {
      RunningPlant& plant = *other.plant;
      if (other.alike) {
        std::copy_n(integrator_->state(), rig_->states(), plant.integrator_->state());
        if (end == substeps_ || !plant.sensors_.empty()) plant.observe(time + end * substep_, count);
      } else if (leads && plant.step_beside(time, other.now, other.next, i, count, motion, *integrator_)) {
        if (end == substeps_ || !plant.sensors_.empty()) plant.observe(time + end * substep_, count);
      } else {
        plant.take_steps(time, other.now, other.next, i, end);
      }
    }
    i = end;
  }
}

void RunningPlant::drive(const double* now, const double* next, int first, int count) {
  const double share = (first + 0.5 * count) / substeps_;
  for (const std::size_t c : run_) true_[c] = now[c] + share * (next[c] - now[c]);
  for (const std::size_t c : held_) true_[c] = now[c];
  for (const Command& c : commands_) {
    const double* const values = &c.values[static_cast<std::size_t>(first)];
    true_[c.channel] = std::accumulate(values, values + count, 0.0) / count;
  }
  for (const Follower& f : followers_)
    true_[f.input] = use_ == Use::simulator ? f.values[static_cast<std::size_t>(first)] : now[f.input];
}

void RunningPlant::step(double time, const double* now, const double* next, int first, int count) {
  drive(now, next, first, count);
  integrator_->step(time + first * substep_, count * substep_, true_.data());
}

bool RunningPlant::step_evenly(double time, const double* now, const double* next, int first) {
  return without_event(*rig_, integrator_->state(), before_, Rig::kUneven,
                       [&] { step(time, now, next, first, even_); });
}

bool RunningPlant::step_beside(double time, const double* now, const double* next, int first, int count, int motion,
                               const Integrator& leader) {
  const auto beside = [&] {
    drive(now, next, first, count);
    integrator_->step_beside(time + first * substep_, count * substep_, true_.data(), leader, Look::again);
  };
  if (!rig_->stiff()) return without_event(*rig_, integrator_->state(), before_, motion, beside);
  beside();
  return true;
}

void RunningPlant::move_to(const double* nominal_state, const double* channels, const double* added) {
  double* state = integrator_->state();
  std::fill(rest_.begin(), rest_.end(), 0);
  std::fill(moved_.begin(), moved_.end(), 0);
  rig_->start_at(state, channels, rest_.data());
  rig_->start_at(nominal_state, channels, moved_.data());
  for (std::size_t i = 0; i < rest_.size(); ++i) state[i] = moved_[i] + (state[i] - rest_[i]);
  const std::size_t own = sheet_.states.size();
  for (std::size_t i = own; added && i < rest_.size(); ++i)
    if (!std::isnan(added[i - own])) state[i] = moved_[i] + added[i - own];
  rig_->set_modes(state);
}

void RunningPlant::integrate_inputs(const Recording& recording, std::size_t row) {
  for (const Rig::Integral& integral : rig_->integrals()) {
    double& sum = integrator_->state()[integral.state];
    sum = 0;
    for (std::size_t k = 0; k < row; ++k) {
      const double value = recording.at(k, integral.channel);
      if (std::isfinite(value)) sum += value * (recording.time[k + 1] - recording.time[k]);
    }
  }
}

void RunningPlant::read_added(const double* channels, double* off) {
  if (added() == 0) return;
  const double* state = integrator_->state();
  std::fill(rest_.begin(), rest_.end(), 0);
  rig_->start_at(state, channels, rest_.data());
  for (std::size_t i = sheet_.states.size(); i < rest_.size(); ++i) *off++ = state[i] - rest_[i];
}

void RunningPlant::observe(double time, int count) {
  rig_->outputs(time, integrator_->state(), shown_.data());
  for (Sensor& sensor : sensors_) {
    const double value = shown_[sensor.channel];
    for (int left = count - 1; left > 0 && sensor.remembers; --left)
      sensor.chain->signal(value + (sensor.before - value) * left / count, time - left * substep_);
    shown_[sensor.channel] = sensor.chain->signal(value, time);
    sensor.before = value;
  }
}

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

}  // namespace faultline

// The loops of the control valve on the measured channels (Manninen 2012, section 3.1.5, 3.1.7 and Fig 28; its gains are
// not printed). e: set point minus measurement.
//
//   flow    flow_setpoint = demand_flow d; flow PI: valve_setpoint = clip(kp e + I, 0, 1), I' = ki e, every flow_period;
//           valve and spool loops
//   valve   valve_setpoint = d; P: spool_setpoint = clip(1/2 + kp e, 0, 1), every position_period; spool loop: U =
//           clip(u0 + kp e + I + kd d/dt of minus the filtered spool position, the channel's range), every spool_period
//   open    U = u0 + demand_gain (d - 1/2) + a uniform disturbance within +-voltage_noise, new with each demand
//
// d: the raw set point, taken every demand_period, plus first-order noise, clipped. Set points that a scheme does not use
// are 0.
#include <algorithm>
#include <cmath>

#include "faultline/numerics/random.h"
#include "faultline/rig/controller.h"

namespace faultline {
namespace {

// Times at which a loop of its own period is due, as the calls come: k * period.
class Schedule {
 public:
  explicit Schedule(double period) : period_(period) {}
  void reset() { next_ = 0; }
  bool due(double time) {
    if (time < static_cast<double>(next_) * period_ * (1 - 1e-9)) return false;
    ++next_;
    return true;
  }
  double period() const { return period_; }

 private:
  double period_;  // s
  std::uint64_t next_ = 0;
};

class Demand {
 public:
  Demand(const Settings& settings, RawSetPoints raw)
      : raw_(std::move(raw.first)),
        seed_(raw.seed),
        random_(seed_),
        schedule_(settings.number("demand_period", 1e-3, 1e3)),
        noise_std_(settings.number("demand_noise", 0, 1)),
        memory_(std::exp(-schedule_.period() / settings.number("demand_noise_time", 1e-3, 1e6))),
        lowest_(settings.number("demand_lowest", 0, 1)),
        highest_(settings.number("demand_highest", lowest_, 1)) {
    if (raw.second)
      throw InputError(settings.where() +
                       ": this controller follows one raw set point; take 'second' out of the profile");
  }

  void reset() {
    random_ = Random(seed_);
    schedule_.reset();
    noise_ = noise_std_ * random_.normal();
  }
  // True where there is a new one.
  bool update(double time) {
    if (!schedule_.due(time)) return false;
    noise_ = memory_ * noise_ + std::sqrt(1 - memory_ * memory_) * noise_std_ * random_.normal();
    value_ = std::clamp(raw_->value(time) + noise_, lowest_, highest_);
    return true;
  }
  double value() const { return value_; }
  Random& random() { return random_; }

 private:
  std::unique_ptr<Excitation> raw_;
  std::uint64_t seed_;
  Random random_;
  Schedule schedule_;
  double noise_std_, memory_, lowest_, highest_;
  double noise_ = 0, value_ = 0;
};

// An integral waits while its output is beyond a limit and the error drives it on.
void integrate(double& integral, double output, double error, double rate, double low, double high) {
  const bool beyond = (output > high && error > 0) || (output < low && error < 0);
  if (!beyond) integral += rate * error;
}

class ValveLoops : public Controller {
 public:
  ValveLoops(const Datasheet& sheet, const Settings& settings, RawSetPoints raw)
      : demand_(settings, std::move(raw)),
        position_schedule_(settings.number("position_period", sheet.sample_period, 10)),
        position_gain_(settings.number("position_gain", 0, 1e3)),
        spool_period_(settings.number("spool_period", 1e-5, sheet.sample_period)),
        bias_(settings.number("spool_bias", 0, 10)),
        gain_(settings.number("spool_gain", 0, 1e3)),
        integral_gain_(settings.number("spool_integral_gain", 0, 1e5)),
        derivative_gain_(settings.number("spool_derivative_gain", 0, 1e3)),
        filter_share_(-std::expm1(-spool_period_ / settings.number("spool_filter", 1e-6, 10))),
        flow_setpoint_(sheet.channel("flow_setpoint")),
        valve_setpoint_(sheet.channel("valve_setpoint")),
        flow_(sheet.channel("flow")),
        valve_(sheet.channel("valve_position")),
        spool_setpoint_(sheet.channel("spool_setpoint")),
        spool_(sheet.channel("spool_position")),
        voltage_(sheet.channel("coil_voltage")) {
    const Channel& voltage = sheet.channels[static_cast<std::size_t>(voltage_)];
    lowest_ = voltage.minimum;
    highest_ = voltage.maximum;
  }

  void reset() override {
    demand_.reset();
    position_schedule_.reset();
    integral_ = 0;
    filtered_ = kNone;
  }

  void step(double time, double* channels) override {
    set_valve(time, channels);
    channels[valve_setpoint_] = wanted_;
    if (position_schedule_.due(time))
      wanted_spool_ = std::clamp(0.5 + position_gain_ * (wanted_ - channels[valve_]), 0.0, 1.0);
    channels[spool_setpoint_] = wanted_spool_;
  }

  double inner_period() const override { return spool_period_; }

  void inner_step(double, double* channels) override {
    const double spool = channels[spool_], error = channels[spool_setpoint_] - spool;
    if (filtered_ == kNone) filtered_ = spool;
    const double before = filtered_;
    filtered_ += filter_share_ * (spool - filtered_);
    const double voltage = bias_ + gain_ * error + integral_ - derivative_gain_ * (filtered_ - before) / spool_period_;
    integrate(integral_, voltage, error, integral_gain_ * spool_period_, lowest_, highest_);
    channels[voltage_] = std::clamp(voltage, lowest_, highest_);
  }

 protected:
  // Sets wanted_, and channels[flow_setpoint_] where there is one.
  virtual void set_valve(double time, double* channels) {
    demand_.update(time);
    wanted_ = demand_.value();
    channels[flow_setpoint_] = 0;
  }

  Demand demand_;
  double wanted_ = 0;  // valve position, 0..1

 private:
  static constexpr double kNone = -1e9;
  Schedule position_schedule_;
  double position_gain_, spool_period_, bias_, gain_, integral_gain_, derivative_gain_, filter_share_;

 protected:
  int flow_setpoint_, valve_setpoint_, flow_, valve_;

 private:
  int spool_setpoint_, spool_, voltage_;
  double lowest_ = 0, highest_ = 0;
  double wanted_spool_ = 0.5, integral_ = 0, filtered_ = kNone;
};

class ValveScheme : public ValveLoops {
 public:
  ValveScheme(const Datasheet& sheet, const Settings& settings, RawSetPoints raw)
      : ValveLoops(sheet, settings, std::move(raw)) {
    settings.check_used();
  }
};

class FlowScheme : public ValveLoops {
 public:
  FlowScheme(const Datasheet& sheet, const Settings& settings, RawSetPoints raw)
      : ValveLoops(sheet, settings, std::move(raw)),
        schedule_(settings.number("flow_period", sheet.sample_period, 1e3)),
        gain_(settings.number("flow_gain", 0, 1e6)),
        integral_gain_(settings.number("flow_integral_gain", 0, 1e6)),
        demand_flow_(settings.number("demand_flow", 1e-9, 1e3)) {
    settings.check_used();
  }

  void reset() override {
    ValveLoops::reset();
    schedule_.reset();
    started_ = false;
  }

 private:
  void set_valve(double time, double* channels) override {
    demand_.update(time);
    channels[flow_setpoint_] = demand_flow_ * demand_.value();
    if (!schedule_.due(time)) return;
    const double error = channels[flow_setpoint_] - channels[flow_];
    if (!started_) integral_ = channels[valve_] - gain_ * error;  // without a bump
    started_ = true;
    integrate(integral_, gain_ * error + integral_, error, integral_gain_ * schedule_.period(), 0, 1);
    wanted_ = std::clamp(gain_ * error + integral_, 0.0, 1.0);
  }

  Schedule schedule_;
  double gain_, integral_gain_, demand_flow_;
  double integral_ = 0;
  bool started_ = false;
};

class OpenScheme : public Controller {
 public:
  OpenScheme(const Datasheet& sheet, const Settings& settings, RawSetPoints raw)
      : demand_(settings, std::move(raw)),
        bias_(settings.number("spool_bias", 0, 10)),
        gain_(settings.number("demand_gain", 0, 10)),
        disturbance_(settings.number("voltage_noise", 0, 10)),
        voltage_(sheet.channel("coil_voltage")) {
    settings.check_used();
    for (const char* name : {"flow_setpoint", "valve_setpoint", "spool_setpoint"})
      unused_.push_back(sheet.channel(name));
  }
  void reset() override { demand_.reset(); }
  void step(double time, double* channels) override {
    if (demand_.update(time))
      value_ = bias_ + gain_ * (demand_.value() - 0.5) + demand_.random().uniform(-disturbance_, disturbance_);
    for (const int c : unused_) channels[c] = 0;
    channels[voltage_] = value_;
  }

 private:
  Demand demand_;
  double bias_, gain_, disturbance_;
  int voltage_;
  std::vector<int> unused_;
  double value_ = 0;
};

FAULTLINE_CONTROLLER(flow, {"control_valve/flow", make_controller_of<FlowScheme>});
FAULTLINE_CONTROLLER(valve, {"control_valve/valve", make_controller_of<ValveScheme>});
FAULTLINE_CONTROLLER(open, {"control_valve/open", make_controller_of<OpenScheme>});

}  // namespace
}  // namespace faultline

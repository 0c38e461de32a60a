// Controllers of the servo actuator, run once per sample on the measured channels with nominal parameters.
//
// position_control: feedback-linearising force loop inside a position loop (Mahulkar et al. 2011, equations 9-19).
//   F = A P_L,  F_d = m a - k_v (v - v_d) - k_p (x - x_d) + f^ + F_load,  F_d' = m jerk - k_p (v - v_d)
//   n = A^2 v/compliance + F_d' - k_f (F - F_d),  B = A K sqrt(P_s - sgn(n) P_L)/compliance,  i = n/(B spool_gain)
//   f^ = F_c s + b v_d, where s is the sign of the last v_d above 1 mm/s, through a lag.
//   Stable while (m k_f + b)(b + k_v) > m k_p (Routh, third-order loop).
// open_loop: i = raw - centring * position; the weak centring keeps the piston in its stroke.
#include <algorithm>
#include <cmath>

#include "faultline/rig/controller.h"

namespace faultline {
namespace {

constexpr double kCommandLimit = 10;     // V
constexpr double kSmallestMargin = 1e5;  // Pa, of supply over load pressure, so that the division stays bounded
constexpr double kMovingSpeed = 1e-3;    // m/s, above which the set point counts as moving

double rounded(double value, double resolution) {
  return resolution > 0 ? std::round(value / resolution) * resolution : value;
}

class PositionControl : public Controller {
 public:
  PositionControl(const Datasheet& sheet, const Settings& settings, std::unique_ptr<Excitation> raw)
      : raw_(std::move(raw)), period_(sheet.sample_period) {
    const std::vector<double> nominal = sheet.nominal();
    const auto value = [&](const char* name) { return nominal[static_cast<std::size_t>(sheet.parameter(name))]; };
    area_ = value("ram_area");
    mass_ = value("moving_mass");
    damping_ = value("viscous_damping");
    coulomb_ = value("coulomb_friction");
    compliance_ = value("compliance");
    flow_coefficient_ = value("flow_coefficient");
    spool_gain_ = value("spool_gain");
    position_gain_ = settings.number("position_gain", 0, 1e9);
    velocity_gain_ = settings.number("velocity_gain", 0, 1e9);
    force_gain_ = settings.number("force_gain", 0, 1e6);
    slew_limit_ = settings.number("slew_limit", 1e-9, 1e6);
    pole_ = settings.number("setpoint_pole", 1e-3, 0.5 / sheet.sample_period);
    friction_lag_ = settings.number("friction_lag", 0, 10);
    settings.check_used();
    reference_ = sheet.channel("position_reference");
    command_ = sheet.channel("valve_command");
    position_ = sheet.channel("position");
    velocity_ = sheet.channel("velocity");
    load_pressure_ = sheet.channel("load_pressure");
    supply_ = sheet.channel("supply_pressure");
    load_force_ = sheet.channel("load_force");
    resolution_ = sheet.channels[static_cast<std::size_t>(command_)].resolution;
  }

  void reset() override {
    started_ = false;
    slewed_ = x_ = v_ = a_ = sign_ = smooth_sign_ = 0;
  }

  void step(double time, double* channels) override {
    if (!started_) {
      slewed_ = x_ = channels[position_];
      started_ = true;
    }
    const double target = raw_->value(time);
    slewed_ += std::clamp(target - slewed_, -slew_limit_ * period_, slew_limit_ * period_);
    const double jerk = pole_ * pole_ * pole_ * (slewed_ - x_) - 3 * pole_ * pole_ * v_ - 3 * pole_ * a_;
    a_ += period_ * jerk;
    v_ += period_ * a_;
    x_ += period_ * v_;
    if (std::abs(v_) > kMovingSpeed) sign_ = v_ > 0 ? 1 : -1;
    smooth_sign_ += (friction_lag_ > 0 ? 1 - std::exp(-period_ / friction_lag_) : 1.0) * (sign_ - smooth_sign_);

    const double load_pressure = channels[load_pressure_];
    const double force = area_ * load_pressure;
    const double wanted = mass_ * a_ - velocity_gain_ * (channels[velocity_] - v_) -
                          position_gain_ * (channels[position_] - x_) + coulomb_ * smooth_sign_ + damping_ * v_ +
                          channels[load_force_];
    const double wanted_rate = mass_ * jerk - position_gain_ * (channels[velocity_] - v_);
    const double n = area_ * area_ * channels[velocity_] / compliance_ + wanted_rate - force_gain_ * (force - wanted);
    const double margin = std::max(channels[supply_] - (n > 0   ? load_pressure
                                                        : n < 0 ? -load_pressure
                                                                : 0.0),
                                   kSmallestMargin);
    const double b = area_ * flow_coefficient_ * std::sqrt(margin) / compliance_;
    channels[reference_] = x_;
    channels[command_] = rounded(std::clamp(n / (b * spool_gain_), -kCommandLimit, kCommandLimit), resolution_);
  }

 private:
  std::unique_ptr<Excitation> raw_;
  double period_, area_ = 0, mass_ = 0, damping_ = 0, coulomb_ = 0, compliance_ = 0, flow_coefficient_ = 0,
                  spool_gain_ = 0;
  double position_gain_ = 0, velocity_gain_ = 0, force_gain_ = 0, slew_limit_ = 0, pole_ = 0, friction_lag_ = 0,
         resolution_ = 0;
  int reference_, command_, position_, velocity_, load_pressure_, supply_, load_force_;
  bool started_ = false;
  double slewed_ = 0, x_ = 0, v_ = 0, a_ = 0, sign_ = 0, smooth_sign_ = 0;
};

class OpenLoop : public Controller {
 public:
  OpenLoop(const Datasheet& sheet, const Settings& settings, std::unique_ptr<Excitation> raw)
      : raw_(std::move(raw)), centring_(settings.number("centring", 0, 1e3)) {
    settings.check_used();
    reference_ = sheet.channel("position_reference");
    command_ = sheet.channel("valve_command");
    position_ = sheet.channel("position");
    resolution_ = sheet.channels[static_cast<std::size_t>(command_)].resolution;
  }
  void reset() override {}
  void step(double time, double* channels) override {
    const double voltage = raw_->value(time) - centring_ * channels[position_];
    channels[reference_] = 0;
    channels[command_] = rounded(std::clamp(voltage, -kCommandLimit, kCommandLimit), resolution_);
  }

 private:
  std::unique_ptr<Excitation> raw_;
  double centring_, resolution_ = 0;
  int reference_, command_, position_;
};

FAULTLINE_CONTROLLER(position_control, {"servo_actuator/position_control", make_controller_of<PositionControl>});
FAULTLINE_CONTROLLER(open_loop, {"servo_actuator/open_loop", make_controller_of<OpenLoop>});

}  // namespace
}  // namespace faultline

// Controllers of the hydraulic drive, run once per sample on the measured channels; r is the set point in rad/s.
//
//   open_loop: v = r/speed_per_volt, as the paper's runs
//   speed_pi:  e = r - S_s, v = limit(r/speed_per_volt + k_p e + z, lowest, highest); z += k_i e sample_period, unless
//              v is limited and e drives it further. Not the paper's (its Fig 1 shows "control logic" only).
#include <algorithm>
#include <cmath>

#include "faultline/rig/controller.h"

namespace faultline {
namespace {

double rounded(double value, double resolution) {
  return resolution > 0 ? std::round(value / resolution) * resolution : value;
}

class OpenLoop : public Controller {
 public:
  OpenLoop(const Datasheet& sheet, const Settings& settings, std::unique_ptr<Excitation> raw)
      : raw_(std::move(raw)),
        speed_per_volt_(settings.number("speed_per_volt", 1e-3, 1e6)),
        set_point_(sheet.channel("speed_setpoint")),
        command_(sheet.channel("valve_voltage")),
        resolution_(sheet.channels[static_cast<std::size_t>(command_)].resolution) {
    settings.check_used();
  }
  void reset() override {}
  void step(double time, double* channels) override {
    channels[set_point_] = raw_->value(time);
    channels[command_] = rounded(channels[set_point_] / speed_per_volt_, resolution_);
  }

 private:
  std::unique_ptr<Excitation> raw_;
  double speed_per_volt_;
  int set_point_, command_;
  double resolution_;
};

class SpeedPi : public Controller {
 public:
  SpeedPi(const Datasheet& sheet, const Settings& settings, std::unique_ptr<Excitation> raw)
      : raw_(std::move(raw)),
        speed_per_volt_(settings.number("speed_per_volt", 1e-3, 1e6)),
        proportional_(settings.number("proportional_gain", 0, 1e3)),
        step_gain_(settings.number("integral_gain", 0, 1e3) * sheet.sample_period),
        lowest_(settings.number("lowest_voltage", -5, 5)),
        highest_(settings.number("highest_voltage", lowest_, 5)),
        set_point_(sheet.channel("speed_setpoint")),
        command_(sheet.channel("valve_voltage")),
        speed_(sheet.channel("shaft_speed")),
        resolution_(sheet.channels[static_cast<std::size_t>(command_)].resolution) {
    settings.check_used();
  }
  void reset() override { integral_ = 0; }
  void step(double time, double* channels) override {
    const double set_point = raw_->value(time);
    const double error = set_point - channels[speed_];
    const double wanted = set_point / speed_per_volt_ + proportional_ * error + integral_;
    if (!(wanted > highest_ && error > 0) && !(wanted < lowest_ && error < 0)) integral_ += step_gain_ * error;
    channels[set_point_] = set_point;
    channels[command_] = rounded(std::clamp(wanted, lowest_, highest_), resolution_);
  }

 private:
  std::unique_ptr<Excitation> raw_;
  double speed_per_volt_, proportional_, step_gain_, lowest_, highest_;
  int set_point_, command_, speed_;
  double resolution_, integral_ = 0;
};

FAULTLINE_CONTROLLER(drive_open_loop, {"hydraulic_drive/open_loop", make_controller_of<OpenLoop>});
FAULTLINE_CONTROLLER(drive_speed_pi, {"hydraulic_drive/speed_pi", make_controller_of<SpeedPi>});

}  // namespace
}  // namespace faultline

// Controllers of the pump-controlled cylinder, run once per sample on the recorded position with nominal parameters.
// Structure: Fig 3 of Kilic et al. 2014; the position law is the datasheet's.
//
//   w_1 = (gamma - 1) w_dyn + lambda psi p_sum,  w_2 = w_dyn + psi p_sum,  gamma = A_A/A_B       (2), (4)
//   position: w_dyn = (A_B/D) (position_gain (x_ref - x_f) + velocity_feedforward x_ref'), where x_f is the position
//             through a low pass of filter_cut_off and x_ref the raw set point through a second-order filter of
//             reference_bandwidth and damping 1 whose speed and acceleration are limited
//   speed:    w_dyn = raw - centring x, which keeps the piston in its stroke, rising and falling by acceleration_limit
//             at most
//
// Both clip to the channels' ranges and round to their resolution. p_sum is the profile's second set point, or
// `pressure_sum` where it has none. Pressure is not fed back.
#include <algorithm>
#include <cmath>

#include "faultline/rig/controller.h"

namespace faultline {
namespace {

constexpr double kPi = 3.14159265358979323846;

// The pressure loop: offset speeds beside what moves the piston, and the command channels.
class PumpSpeeds {
 public:
  PumpSpeeds(const Datasheet& sheet, const Settings& settings, std::unique_ptr<Excitation> pressure_sum)
      : pressure_sum_(std::move(pressure_sum)), fixed_sum_(settings.number("pressure_sum", 1e5, 2e7)) {
    const std::vector<double> nominal = sheet.nominal();
    const auto value = [&](const char* name) { return nominal[static_cast<std::size_t>(sheet.parameter(name))]; };
    area_ratio_ = value("cap_area") / value("rod_area");
    offset_ratio_ = value("offset_ratio");
    offset_gain_ = value("offset_gain");
    sum_ = sheet.channel("pressure_sum_reference");
    first_ = sheet.channel("pump1_speed_command");
    second_ = sheet.channel("pump2_speed_command");
    channels_ = sheet.channels;
  }

  void write(double time, double dynamic, double* channels) const {
    const double sum = pressure_sum_ ? pressure_sum_->value(time) : fixed_sum_;
    channels[sum_] = sum;
    put(first_, (area_ratio_ - 1) * dynamic + offset_ratio_ * offset_gain_ * sum, channels);
    put(second_, dynamic + offset_gain_ * sum, channels);
  }

 private:
  void put(int channel, double value, double* channels) const {
    const Channel& c = channels_[static_cast<std::size_t>(channel)];
    value = std::clamp(value, c.minimum, c.maximum);
    channels[channel] = c.resolution > 0 ? std::round(value / c.resolution) * c.resolution : value;
  }

  std::unique_ptr<Excitation> pressure_sum_;
  double fixed_sum_, area_ratio_, offset_ratio_, offset_gain_;
  int sum_, first_, second_;
  std::vector<Channel> channels_;
};

class PositionControl : public Controller {
 public:
  PositionControl(const Datasheet& sheet, const Settings& settings, RawSetPoints raw)
      : raw_(std::move(raw.first)), speeds_(sheet, settings, std::move(raw.second)), period_(sheet.sample_period) {
    const std::vector<double> nominal = sheet.nominal();
    per_speed_ = nominal[static_cast<std::size_t>(sheet.parameter("rod_area"))] /
                 nominal[static_cast<std::size_t>(sheet.parameter("pump_displacement"))];
    gain_ = settings.number("position_gain", 0, 1e4);
    feedforward_ = settings.number("velocity_feedforward", 0, 10);
    const double cut_off = settings.number("filter_cut_off", 1e-3, 0.5 / period_);
    share_ = 1 - std::exp(-2 * kPi * cut_off * period_);
    bandwidth_ = settings.number("reference_bandwidth", 1e-3, 0.5 / period_);
    speed_limit_ = settings.number("speed_limit", 1e-6, 10);
    acceleration_limit_ = settings.number("acceleration_limit", 1e-6, 1e3);
    settings.check_used();
    reference_ = sheet.channel("position_reference");
    position_ = sheet.channel("position");
  }

  void reset() override { started_ = false; }

  void step(double time, double* channels) override {
    const double target = raw_->value(time);
    if (!started_) {
      wanted_ = target;
      speed_ = 0;
      filtered_ = channels[position_];
      started_ = true;
    }
    const double pull = bandwidth_ * bandwidth_ * (target - wanted_) - 2 * bandwidth_ * speed_;
    // Braking in time: from the distance that is left no more speed than the limit of acceleration takes away.
    const double allowed = std::min(
        speed_limit_, std::sqrt(2 * acceleration_limit_ * std::abs(target - wanted_)) + acceleration_limit_ * period_);
    const double next = speed_ + period_ * std::clamp(pull, -acceleration_limit_, acceleration_limit_);
    const double limited = std::clamp(next, -allowed, allowed);
    speed_ = std::clamp(limited, speed_ - acceleration_limit_ * period_, speed_ + acceleration_limit_ * period_);
    wanted_ += period_ * speed_;
    filtered_ += share_ * (channels[position_] - filtered_);
    channels[reference_] = wanted_;
    speeds_.write(time, per_speed_ * (gain_ * (wanted_ - filtered_) + feedforward_ * speed_), channels);
  }

 private:
  std::unique_ptr<Excitation> raw_;
  PumpSpeeds speeds_;
  double period_, per_speed_ = 0, gain_ = 0, feedforward_ = 0, share_ = 0, bandwidth_ = 0, speed_limit_ = 0,
                  acceleration_limit_ = 0;
  int reference_, position_;
  bool started_ = false;
  double wanted_ = 0, speed_ = 0, filtered_ = 0;
};

class SpeedControl : public Controller {
 public:
  SpeedControl(const Datasheet& sheet, const Settings& settings, RawSetPoints raw)
      : raw_(std::move(raw.first)),
        speeds_(sheet, settings, std::move(raw.second)),
        centring_(settings.number("centring", 0, 1e6)),
        most_(settings.number("acceleration_limit", 1e-3, 1e9) * sheet.sample_period) {
    settings.check_used();
    reference_ = sheet.channel("position_reference");
    position_ = sheet.channel("position");
  }

  void reset() override { dynamic_ = 0; }

  void step(double time, double* channels) override {
    const double wanted = raw_->value(time) - centring_ * channels[position_];
    dynamic_ += std::clamp(wanted - dynamic_, -most_, most_);
    channels[reference_] = 0;
    speeds_.write(time, dynamic_, channels);
  }

 private:
  std::unique_ptr<Excitation> raw_;
  PumpSpeeds speeds_;
  double centring_, most_, dynamic_ = 0;
  int reference_, position_;
};

FAULTLINE_CONTROLLER(position, {"pump_cylinder/position", make_controller_of<PositionControl>});
FAULTLINE_CONTROLLER(speed, {"pump_cylinder/speed", make_controller_of<SpeedControl>});

}  // namespace
}  // namespace faultline

// The bench's sequencer: open loop, it issues the bench valve's opening u and the heat load h with limited slew and an
// interlock h <= interlock u, so that no wall is fired on without water. It starts at its first set points, without a
// ramp.
//
//   test_sequence  u is the raw set point; h runs through heat_time, heat_level, linear in between
//   throttling     u is the raw set point; h is heat_level from heat_start on
//   firing         h is the raw set point; u is valve_level
//   throttled_firing  u is the first raw set point, h the second
#include <algorithm>

#include "faultline/rig/controller.h"

namespace faultline {
namespace {

constexpr double kFastest = 1e6;  // 1/s

class Sequencer : public Controller {
 public:
  Sequencer(const Datasheet& sheet, const Settings& settings)
      : valve_(sheet.channel("bench_valve_command")),
        heat_(sheet.channel("heat_load_command")),
        valve_step_(settings.number("valve_rate", 1e-6, kFastest) * sheet.sample_period),
        heat_step_(settings.number("heat_rate", 1e-6, kFastest) * sheet.sample_period),
        interlock_(settings.number("interlock", 0, 1e3)) {}

  void reset() override { started_ = false; }

  void step(double time, double* channels) override {
    const double u = std::clamp(valve_set_point(time), 0.0, 1.0), h = std::max(heat_set_point(time), 0.0);
    opening_ = started_ ? opening_ + std::clamp(u - opening_, -valve_step_, valve_step_) : u;
    level_ = started_ ? level_ + std::clamp(h - level_, -heat_step_, heat_step_) : h;
    level_ = std::min(level_, interlock_ * opening_);
    started_ = true;
    channels[valve_] = opening_;
    channels[heat_] = level_;
  }

 protected:
  virtual double valve_set_point(double time) = 0;
  virtual double heat_set_point(double time) = 0;

 private:
  int valve_, heat_;
  double valve_step_, heat_step_, interlock_;
  bool started_ = false;
  double opening_ = 0, level_ = 0;
};

class TestSequence : public Sequencer {
 public:
  TestSequence(const Datasheet& sheet, const Settings& settings, std::unique_ptr<Excitation> raw)
      : Sequencer(sheet, settings),
        raw_(std::move(raw)),
        heat_(make_excitation("table",
                              Settings(settings.where(), {},
                                       {{"time", settings.list("heat_time", 0, 0, 1e9)},
                                        {"value", settings.list("heat_level", 0, 0, 1e3)}},
                                       {}),
                              0)) {
    settings.check_used();
  }

 private:
  double valve_set_point(double time) override { return raw_->value(time); }
  double heat_set_point(double time) override { return heat_->value(time); }
  std::unique_ptr<Excitation> raw_, heat_;
};

class Throttling : public Sequencer {
 public:
  Throttling(const Datasheet& sheet, const Settings& settings, std::unique_ptr<Excitation> raw)
      : Sequencer(sheet, settings),
        raw_(std::move(raw)),
        start_(settings.number("heat_start", 0, 1e9)),
        level_(settings.number("heat_level", 0, 1e3)) {
    settings.check_used();
  }

 private:
  double valve_set_point(double time) override { return raw_->value(time); }
  double heat_set_point(double time) override { return time < start_ ? 0 : level_; }
  std::unique_ptr<Excitation> raw_;
  double start_, level_;
};

class Firing : public Sequencer {
 public:
  Firing(const Datasheet& sheet, const Settings& settings, std::unique_ptr<Excitation> raw)
      : Sequencer(sheet, settings), raw_(std::move(raw)), opening_(settings.number("valve_level", 0, 1)) {
    settings.check_used();
  }

 private:
  double valve_set_point(double) override { return opening_; }
  double heat_set_point(double time) override { return raw_->value(time); }
  std::unique_ptr<Excitation> raw_;
  double opening_;
};

class ThrottledFiring : public Sequencer {
 public:
  ThrottledFiring(const Datasheet& sheet, const Settings& settings, RawSetPoints raw)
      : Sequencer(sheet, settings), valve_(std::move(raw.first)), heat_(std::move(raw.second)) {
    settings.check_used();
    if (!heat_)
      throw InputError(settings.where() + ": this controller follows two raw set points; give the profile a 'second'");
  }

 private:
  double valve_set_point(double time) override { return valve_->value(time); }
  double heat_set_point(double time) override { return heat_->value(time); }
  std::unique_ptr<Excitation> valve_, heat_;
};

FAULTLINE_CONTROLLER(test_sequence, {"cooling_circuit/test_sequence", make_controller_of<TestSequence>});
FAULTLINE_CONTROLLER(throttling, {"cooling_circuit/throttling", make_controller_of<Throttling>});
FAULTLINE_CONTROLLER(firing, {"cooling_circuit/firing", make_controller_of<Firing>});
FAULTLINE_CONTROLLER(throttled_firing, {"cooling_circuit/throttled_firing", make_controller_of<ThrottledFiring>});

}  // namespace
}  // namespace faultline

#include "nodes/rig_simulator.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <thread>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <ros/ros.h>

#include "faultline/signal/error.h"
#include "nodes/conversion.h"
#include "nodes/conversion_lcm.h"
#include "nodes/lcm_name.h"
#include "nodes/node_main.h"

namespace faultline {
namespace {

using diagnostic_msgs::DiagnosticStatus;

constexpr double kWorthTelling = 0.1;  // s behind the clock

void add_effects(const std::vector<std::string>& texts, SimulationSetup& setup) {
  for (const std::string& text : texts) setup.effects.push_back(parse_effect(text));
}

}  // namespace

RigSimulatorSettings read_simulator_settings(const Datasheet& sheet, Parameters& parameters) {
  RigSimulatorSettings settings;
  SimulationSetup& setup = settings.setup;
  const std::string fault_name = parameters.word("fault", "");
  setup.profile = parameters.word("profile", "");
  setup.seed = static_cast<std::uint64_t>(parameters.integer("seed", 1, 0, 2147483647));
  add_effects(parameters.words("effects"), setup);
  if (!fault_name.empty()) {
    const Fault& fault = sheet.fault(fault_name);
    add_effects(fault.effects, setup);
    setup.commands = fault.commands;
    if (setup.profile.empty()) setup.profile = fault.profile;
  }
  if (!setup.profile.empty()) sheet.profile(setup.profile);
  if (parameters.flag("nuisance", false)) add_effects(sheet.nuisance, setup);
  if (parameters.flag("off_nominal", false)) setup.parameters = draw_parameters(sheet, setup.seed);
  // A slow rig may run up to a sample every millisecond.
  settings.rate = parameters.number("rate", 1, 0.01, std::max(100.0, 1000 * sheet.sample_period));
  settings.duration = parameters.number("duration", 0, 0, 1e8);
  const double now = std::floor(ros::WallTime::now().toSec() * 1000) / 1000;
  settings.start = parameters.number("start", now, 0, 4e9);
  settings.over_lcm = parameters.choice("output", "ros", {"lcm", "ros"}) == "lcm";
  settings.lcm_url = parameters.word("lcm_url", "");
  settings.lcm_name = read_lcm_name(parameters);
  if (settings.lcm_name.empty()) settings.lcm_name = sheet.rig;

  std::vector<std::string> effects;
  for (const EffectSpec& effect : setup.effects) effects.push_back(to_string(effect));
  settings.made_by = fmt::format("rig_simulator_node: profile {}, seed {}, fault {}, effects [{}]{}",
                                 setup.profile.empty() ? "default" : setup.profile, setup.seed,
                                 fault_name.empty() ? "none" : fault_name, fmt::join(effects, "; "),
                                 setup.parameters.empty() ? "" : ", parameters off nominal");
  return settings;
}

RigSimulator::RigSimulator(const Datasheet& sheet, const RigSimulatorSettings& settings, Listeners listeners)
    : sheet_(sheet), settings_(settings), simulator_(sheet, settings.setup), listeners_(std::move(listeners)) {
  if (settings_.over_lcm) {
    lcm_ = std::make_unique<lcm::LCM>(settings_.lcm_url);
    if (!lcm_->good())
      throw InputError(fmt::format(
          "parameter ~lcm_url: LCM cannot open '{}'; udpm://, file://PATH?mode=w or memq:// is allowed, and "
          "udpm needs a multicast route",
          settings_.lcm_url));
  } else {
    description_ = node_.advertise<faultline_msgs::RigDescription>("description", 1, true);
    samples_ = listeners_.advertise<faultline_msgs::Sample>(node_, "sample");
    end_ = std::make_unique<EndOfRun>();
  }
  health_ =
      std::make_unique<NodeHealth>(sheet.rig, "simulator", [this](diagnostic_updater::DiagnosticStatusWrapper& status) {
        status.summary(DiagnosticStatus::OK, "samples are sent");
        if (most_behind_ > kWorthTelling)
          status.mergeSummaryf(DiagnosticStatus::WARN, "up to %.3f s behind the clock: the machine is too slow",
                               most_behind_);
        if (failed_rise_.since_last(failed_))
          status.mergeSummary(DiagnosticStatus::ERROR, "LCM refused samples; check route and space");
        status.add("samples per second", rate_.rate(sent_));
        status.add("sent", sent_);
        status.add("refused by LCM", failed_);
        status.add("behind [s]", behind_);
        most_behind_ = 0;
      });
}

void RigSimulator::send_description() {
  if (lcm_) {
    const faultline_lcm::rig_description_t message = to_lcm(sheet_);
    lcm_->publish(lcm_channel(settings_.lcm_name, "description"), &message);
  } else {
    faultline_msgs::RigDescription message = to_message(sheet_, settings_.made_by);
    message.header.stamp = to_stamp(settings_.start);
    description_.publish(message);
  }
}

void RigSimulator::send(const Sample& sample) {
  if (lcm_) {
    const faultline_lcm::sample_t message = to_lcm(sample);
    if (lcm_->publish(lcm_channel(settings_.lcm_name, "sample"), &message) != 0) ++failed_;
  } else {
    samples_.publish(to_message(sample, sheet_.rig));
  }
  ++sent_;
}

void RigSimulator::run() {
  const double period = sheet_.sample_period;
  const std::uint64_t last =
      settings_.duration > 0 ? static_cast<std::uint64_t>(std::llround(settings_.duration / period)) : UINT64_MAX;
  const std::uint64_t second = std::max<std::uint64_t>(1, static_cast<std::uint64_t>(std::llround(1 / period)));
  const double wall_period = period / settings_.rate;

  send_description();
  if (!lcm_) listeners_.wait();
  const double begin = steady_seconds();
  Sample sample;
  for (std::uint64_t k = 0; k <= last && ros::ok();) {
    const double elapsed = steady_seconds() - begin;
    // After a hold-up the rest is sent in portions, so that ROS gets its turn.
    for (int portion = 0; portion < 1000 && k <= last && static_cast<double>(k) * wall_period <= elapsed;
         ++portion, ++k) {
      if (lcm_ && k > 0 && k % second == 0) send_description();
      sample = simulator_.step();
      sample.time += settings_.start;
      sample.sequence = k;
      send(sample);
    }
    ros::spinOnce();
    behind_ = steady_seconds() - begin - static_cast<double>(k) * wall_period;
    most_behind_ = std::max(most_behind_, behind_);
    // Sleeps to the next sample, but not more than a thousand times a second (what is due then goes together), and not
    // so long that ROS has to wait.
    if (behind_ < 0)
      std::this_thread::sleep_for(std::chrono::duration<double>(std::clamp(-behind_, 1e-3 - wall_period, 0.1)));
  }
  if (!ros::ok()) return;
  if (end_ && sent_ > 0)
    end_->tell(sample.time);
  else
    linger();
}

}  // namespace faultline

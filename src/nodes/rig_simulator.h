// The rig's stand-in on the network: runs the rig simulator at the pace of a steady clock and sends every sample as a
// DAQ would, over LCM or straight to ROS. Stamps are `start` plus the simulator's time; numbers count from 0. The
// description goes first, and over LCM again once a second. When the machine is too slow the samples come late, but all
// of them come.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include <ros/node_handle.h>
#include <lcm/lcm-cpp.hpp>

#include "faultline/rig/simulator.h"
#include "nodes/end_of_run.h"
#include "nodes/node_health.h"
#include "nodes/node_main.h"
#include "nodes/parameters.h"

namespace faultline {

struct RigSimulatorSettings {
  SimulationSetup setup;
  std::string made_by;
  double rate = 1;      // times real time
  double duration = 0;  // s of simulated time; 0: until stopped
  double start = 0;     // s, stamp of the first sample
  bool over_lcm = false;
  std::string lcm_url, lcm_name;
};

// Throws InputError for what the datasheet does not know.
RigSimulatorSettings read_simulator_settings(const Datasheet& sheet, Parameters& parameters);

class RigSimulator {
 public:
  RigSimulator(const Datasheet& sheet, const RigSimulatorSettings& settings, Listeners listeners);
  void run();  // until the duration is over or ROS ends

 private:
  void send_description();
  void send(const Sample& sample);

  const Datasheet& sheet_;
  RigSimulatorSettings settings_;
  Simulator simulator_;
  Listeners listeners_;
  ros::NodeHandle node_;
  ros::Publisher samples_, description_;
  std::unique_ptr<EndOfRun> end_;  // of a run over ROS
  std::unique_ptr<lcm::LCM> lcm_;
  std::uint64_t sent_ = 0, failed_ = 0;
  Rise failed_rise_;
  double behind_ = 0, most_behind_ = 0;  // s of wall time
  RateMeter rate_;
  std::unique_ptr<NodeHealth> health_;
};

}  // namespace faultline

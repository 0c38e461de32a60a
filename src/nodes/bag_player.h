// Plays the samples of a recorded bag in simulated time: /RIG/description and /RIG/sample at the recorded pace times
// `rate`, and /clock. In place of `rosbag play`, which begins as soon as anybody listens, a recorder for instance, and
// is gone before the last samples are judged. A description without a stamp gets the first sample's, so that who comes
// late knows what was missed; with one it says what the recording missed.
#pragma once

#include <memory>
#include <string>

#include <ros/node_handle.h>
#include <rosbag/bag.h>
#include <std_srvs/SetBool.h>

#include "nodes/node_main.h"
#include "nodes/parameters.h"

namespace faultline {

struct BagPlayerSettings {
  std::string file;
  std::string recorded;  // namespace of the topics in the bag
  double rate = 1;       // times the recorded pace
  double hz = 1000;      // of /clock, wall time
  bool loop = false, pause = false;
};

BagPlayerSettings read_player_settings(Parameters& parameters);

class BagPlayer {
 public:
  // InputError where the bag cannot be read or has no sample.
  BagPlayer(const BagPlayerSettings& settings, Listeners listeners);
  // Once its listeners are there, until the bag is over and judged; with `loop`, until ROS ends.
  void run();

 private:
  void play_once();
  void wait_until(double due);  // s of the bag's own time, from its start
  void tell_clock(double now);
  bool pause(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response);

  BagPlayerSettings settings_;
  rosbag::Bag bag_;
  Listeners listeners_;
  ros::Time first_stamp_, last_stamp_, start_;
  ros::NodeHandle node_, private_node_;
  ros::Publisher description_, samples_, clock_;
  ros::ServiceServer service_;
  bool paused_ = false;
  double played_ = 0;         // s of the bag's own time
  double wall_ = 0;           // s, steady time at which that was
  double clock_told_ = -1e9;  // s, steady time
};

}  // namespace faultline

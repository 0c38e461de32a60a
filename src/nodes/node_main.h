// What every node's main does, once: start ROS, look for the master, run, and turn what goes wrong into one line on
// stderr and an exit code: 0 the job ran, 1 no master or an unforeseen failure, 2 bad parameters or bad input.
#pragma once

#include <functional>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include <ros/node_handle.h>

#include "faultline/rig/datasheet.h"
#include "nodes/parameters.h"

namespace faultline {

// Messages that a queue holds: 10 s at 10 kHz.
constexpr unsigned kQueue = 100000;

// `body` gets the node's parameters, runs until the node is to end, and returns the exit code.
int run_node(int argc, char** argv, const std::string& name, const std::function<int(Parameters&)>& body);

// The datasheet of ~rig in ~config; by default in the package's folder config, or where a rig outside this tree is
// (rig_packages.h).
Datasheet read_rig(Parameters& parameters);

// The nodes that must hear a publisher's first message: ROS drops what is published before a subscriber is connected,
// and with the first samples a diagnosis would lose its start. By name, for whoever else listens (a recorder, a plot)
// is no reason to begin. Others that the master knows as subscribers by then, such as a recorder that was there first,
// are waited for too, but briefly: one that was killed stays registered.
class Listeners {
 public:
  // ~wait_for: nodes of this node's namespace, spaces between.
  explicit Listeners(Parameters& parameters);
  // A topic that they must hear.
  template <class Message>
  ros::Publisher advertise(ros::NodeHandle& node, const std::string& topic) {
    topics_.push_back(node.advertise<Message>(topic, kQueue, heard()));
    return topics_.back();
  }
  // Holds the start back until all are there, 10 s of wall time at most, and then 2 s at most for other subscribers.
  void wait() const;

 private:
  ros::SubscriberStatusCallback heard() const;

  std::shared_ptr<std::set<std::string>> missing_;
  std::vector<ros::Publisher> topics_;
};

// At the end of a node's job, a second: ROS sends from a thread of its own and drops what is still queued when the node
// ends.
void linger();

// Simulated time is on and stands at 0, and nobody publishes it.
bool without_clock();
// What a node says of it (clock_watch.h): on its log once, and on /diagnostics while it lasts.
constexpr char kWithoutClock[] =
    "simulated time is on but nobody publishes /clock, so time stands still; start the player, or rosparam set "
    "/use_sim_time false and start the nodes anew";

// Seconds on a clock that no one sets.
double steady_seconds();

}  // namespace faultline

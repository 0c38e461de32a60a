#include "nodes/node_main.h"

#include <chrono>
#include <exception>
#include <iostream>
#include <sstream>
#include <thread>

#include <fmt/format.h>
#include <ros/master.h>
#include <ros/names.h>
#include <ros/package.h>
#include <ros/ros.h>
#include <ros/topic_manager.h>

#include "faultline/signal/error.h"
#include "nodes/clock_watch.h"
#include "nodes/rig_packages.h"

namespace faultline {
namespace {

constexpr double kMasterWait = 3;     // s: roslaunch may still be starting it
constexpr double kListenerWait = 10;  // s
constexpr double kOthersWait = 2;     // s

bool find_master() {
  const double end = steady_seconds() + kMasterWait;
  do {
    if (ros::master::check()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
  } while (steady_seconds() < end && !ros::isShuttingDown());
  return false;
}

// Whether as many nodes are connected to each topic as the master knows subscribers of it.
bool all_connected(const std::vector<ros::Publisher>& topics) {
  XmlRpc::XmlRpcValue request, response, state;
  request[0] = ros::this_node::getName();
  if (!ros::master::execute("getSystemState", request, response, state, false)) return true;
  XmlRpc::XmlRpcValue& subscribers = state[1];  // of each topic its name and its nodes
  for (int i = 0; i < subscribers.size(); ++i) {
    const std::string topic = subscribers[i][0];
    const int known = subscribers[i][1].size();
    for (const ros::Publisher& publisher : topics)
      if (publisher.getTopic() == topic && static_cast<int>(publisher.getNumSubscribers()) < known) return false;
  }
  return true;
}

// Until something holds, `seconds` at most; whether it does.
bool wait_until(double seconds, const std::function<bool()>& holds) {
  for (const double end = steady_seconds() + seconds; !holds();) {
    if (steady_seconds() > end || !ros::ok()) return false;
    ros::spinOnce();
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return true;
}

}  // namespace

bool without_clock() {
  // ROS subscribes to /clock by itself where simulated time is on.
  return ros::Time::isSimTime() && ros::Time::now().isZero() &&
         ros::TopicManager::instance()->getNumPublishers("/clock") == 0;
}

double steady_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

int run_node(int argc, char** argv, const std::string& name, const std::function<int(Parameters&)>& body) {
  try {
    ros::init(argc, argv, name);
    if (argc > 1) {
      std::cerr << name << ": '" << argv[1]
                << "' is not understood; parameters are given as _key:=value, and docs/nodes.md lists them\n";
      return 2;
    }
    if (!find_master()) {
      std::cerr << name << ": no ROS master at " << ros::master::getURI()
                << "; start roscore or roslaunch, or set ROS_MASTER_URI\n";
      return 1;
    }
    const ros::NodeHandle alive;  // ROS ends with the last handle; this one outlives the body's
    ClockWatch clock;
    bool told = false;
    const ros::WallTimer clock_timer =
        alive.createWallTimer(ros::WallDuration(1), [&clock, &told](const ros::WallTimerEvent&) {
          if (told || !clock.missing(steady_seconds(), without_clock())) return;
          told = true;
          ROS_WARN("%s", kWithoutClock);
        });
    Parameters parameters;
    return body(parameters);
  } catch (const InputError& error) {
    std::cerr << name << ": " << error.what() << "\n";
    return 2;
  } catch (const std::exception& error) {
    std::cerr << name << ": " << error.what() << "\n";
    return 1;
  }
}

Datasheet read_rig(Parameters& parameters) {
  std::string folder = parameters.word("config", "");
  const bool given = !folder.empty();
  if (!given) {
    const std::string package = ros::package::getPath("faultline");
    if (package.empty())
      throw InputError(
          "package faultline is not on ROS_PACKAGE_PATH; source setup.bash, or give the folder of datasheets as "
          "_config:=");
    folder = package + "/config";
  }
  if (!parameters.has("rig"))
    throw InputError(fmt::format("{}: parameter ~rig is missing; name a rig of {}", ros::this_node::getName(), folder));
  const std::string rig = parameters.word("rig");
  for (const std::string& line : left_out(rig)) ROS_WARN("%s", line.c_str());
  if (!given) return find_datasheet(folder, outside_rigs(), rig);
  load_rig(outside_rigs(), rig);
  return find_datasheet(folder, rig);
}

void linger() {
  for (int i = 0; i < 120 && ros::ok(); ++i) {
    ros::spinOnce();
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
}

Listeners::Listeners(Parameters& parameters) : missing_(std::make_shared<std::set<std::string>>()) {
  std::istringstream names(parameters.word("wait_for", ""));
  for (std::string name; names >> name;) missing_->insert(ros::names::resolve(name));
}

ros::SubscriberStatusCallback Listeners::heard() const {
  return [missing = missing_](const ros::SingleSubscriberPublisher& one) { missing->erase(one.getSubscriberName()); };
}

void Listeners::wait() const {
  if (!wait_until(kListenerWait, [this] { return missing_->empty(); }) && ros::ok())
    ROS_WARN("%s does not listen after %g s; going on without", missing_->begin()->c_str(), kListenerWait);
  if (!wait_until(kOthersWait, [this] { return all_connected(topics_); }) && ros::ok())
    ROS_WARN("a subscriber of %s does not connect within %g s; going on without (rosnode cleanup removes dead ones)",
             topics_.front().getTopic().c_str(), kOthersWait);
}

}  // namespace faultline

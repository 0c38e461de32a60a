#include "nodes/bag_player.h"

#include <algorithm>
#include <chrono>
#include <thread>

#include <fmt/format.h>
#include <ros/ros.h>
#include <rosbag/view.h>
#include <rosgraph_msgs/Clock.h>

#include "faultline/signal/error.h"
#include "nodes/conversion.h"
#include "nodes/end_of_run.h"

namespace faultline {
namespace {

constexpr double kNap = 1e-3;  // s

std::vector<std::string> topics_of(const BagPlayerSettings& settings) {
  return {"/" + settings.recorded + "/description", "/" + settings.recorded + "/sample"};
}

// Of a message in the bag; null where it is another topic's.
template <class Message>
boost::shared_ptr<Message> read(const rosbag::MessageInstance& message, const BagPlayerSettings& settings) {
  const boost::shared_ptr<Message> read = message.instantiate<Message>();
  if (!read)
    throw InputError(fmt::format("{}: what {} holds is a {}, of another version or another type; make the bag anew",
                                 settings.file, message.getTopic(), message.getDataType()));
  return read;
}

}  // namespace

BagPlayerSettings read_player_settings(Parameters& parameters) {
  BagPlayerSettings settings;
  settings.file = parameters.word("bag");
  settings.recorded = parameters.word("recorded");
  settings.rate = parameters.number("rate", 1, 0.001, 1000);
  settings.hz = parameters.number("hz", 1000, 1, 10000);
  settings.loop = parameters.flag("loop", false);
  settings.pause = parameters.flag("pause", false);
  return settings;
}

BagPlayer::BagPlayer(const BagPlayerSettings& settings, Listeners listeners)
    : settings_(settings), listeners_(std::move(listeners)), private_node_("~"), paused_(settings.pause) {
  try {
    bag_.open(settings_.file, rosbag::bagmode::Read);
  } catch (const rosbag::BagException& error) {
    throw InputError(fmt::format("{}: cannot be read as a bag: {}", settings_.file, error.what()));
  }
  const std::string topic = topics_of(settings_)[1];
  rosbag::View view(bag_, rosbag::TopicQuery(topic));
  if (view.begin() == view.end())
    throw InputError(fmt::format(
        "{}: there is nothing on {}; give the namespace that it was recorded in as recorded:=", settings_.file, topic));
  first_stamp_ = read<faultline_msgs::Sample>(*view.begin(), settings_)->header.stamp;
  description_ = node_.advertise<faultline_msgs::RigDescription>("description", 1, true);
  samples_ = listeners_.advertise<faultline_msgs::Sample>(node_, "sample");
  clock_ = node_.advertise<rosgraph_msgs::Clock>("/clock", 100);
  service_ = private_node_.advertiseService("pause_playback", &BagPlayer::pause, this);
}

bool BagPlayer::pause(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response) {
  response.success = paused_ != static_cast<bool>(request.data);
  paused_ = request.data;
  response.message = paused_ ? "paused" : "plays";
  return true;
}

void BagPlayer::run() {
  EndOfRun end;
  listeners_.wait();
  do play_once();
  while (settings_.loop && ros::ok());
  if (ros::ok()) end.tell(to_seconds(last_stamp_));
}

void BagPlayer::play_once() {
  rosbag::View view(bag_, rosbag::TopicQuery(topics_of(settings_)));
  start_ = view.getBeginTime();
  played_ = 0;
  wall_ = steady_seconds();
  for (const rosbag::MessageInstance& message : view) {
    wait_until((message.getTime() - start_).toSec());
    if (!ros::ok()) return;
    if (message.getTopic() == topics_of(settings_)[0]) {
      const auto description = read<faultline_msgs::RigDescription>(message, settings_);
      if (description->header.stamp.isZero()) description->header.stamp = first_stamp_;
      description_.publish(description);
    } else {
      const auto sample = read<faultline_msgs::Sample>(message, settings_);
      last_stamp_ = sample->header.stamp;
      samples_.publish(sample);
    }
  }
}

void BagPlayer::wait_until(double due) {
  while (ros::ok()) {
    const double now = steady_seconds();
    if (!paused_) played_ += (now - wall_) * settings_.rate;
    wall_ = now;
    if (now - clock_told_ > 1 / settings_.hz) {
      clock_told_ = now;
      tell_clock(std::min(played_, due));
      ros::spinOnce();
    }
    if (!paused_ && played_ >= due) return;
    // Sleeps no more than a thousand times a second: what is due then goes together.
    std::this_thread::sleep_for(std::chrono::duration<double>(kNap));
  }
}

void BagPlayer::tell_clock(double now) {
  rosgraph_msgs::Clock message;
  message.clock = start_ + ros::Duration(now);
  clock_.publish(message);
}

}  // namespace faultline

#include "nodes/plot_topics.h"

#include <algorithm>
#include <cctype>
#include <cmath>

#include "nodes/conversion.h"

namespace faultline {
namespace {

constexpr unsigned kPlotQueue = 1000;

// A name that ROS allows in a topic.
std::string topic_word(std::string name) {
  std::replace_if(
      name.begin(), name.end(), [](unsigned char letter) { return std::isalnum(letter) == 0 && letter != '/'; }, '_');
  return name;
}

}  // namespace

PlotTopics::PlotTopics(const Datasheet& sheet, double rate) : rig_(sheet.rig), period_(1 / rate) {
  for (const Channel& channel : sheet.channels)
    channels_.topics.push_back(node_.advertise<faultline_msgs::Scalar>("plot/channel/" + channel.name, kPlotQueue));
}

// A tenth of a period early is early enough, so that stamps with jitter do not halve the rate.
bool PlotTopics::due(Group& group, double time) const {
  if (group.last >= 0 && time >= group.last && time < group.last + 0.9 * period_) return false;
  group.last = time;
  return true;
}

void PlotTopics::publish(const ros::Publisher& topic, double time, double value) {
  if (topic.getNumSubscribers() == 0) return;
  scalar_.header.stamp = to_stamp(time);
  scalar_.header.frame_id = rig_;
  scalar_.value = value;
  topic.publish(scalar_);
}

void PlotTopics::show(const Sample& sample) {
  if (!due(channels_, sample.time)) return;
  for (std::size_t i = 0; i < channels_.topics.size(); ++i) publish(channels_.topics[i], sample.time, sample.values[i]);
}

void PlotTopics::show(const faultline_msgs::Estimate& estimate) {
  Group& group = stages_[estimate.stage];
  const double time = to_seconds(estimate.header.stamp);
  const std::size_t states = estimate.state_names.size(), quantities = estimate.quantities.size();
  const std::size_t residuals = estimate.channel_names.size();
  if (group.topics.empty()) {
    const std::string stage = "plot/" + topic_word(estimate.stage);
    const auto advertise = [&](const std::string& kind, const std::string& name) {
      group.topics.push_back(
          node_.advertise<faultline_msgs::Scalar>(stage + "/" + kind + "/" + topic_word(name), kPlotQueue));
    };
    for (const std::string& name : estimate.state_names) advertise("state", name);
    for (const faultline_msgs::Quantity& quantity : estimate.quantities) advertise("quantity", quantity.name);
    for (const std::string& name : estimate.channel_names) advertise("residual", name);
  }
  if (group.topics.size() != states + quantities + residuals || estimate.state.size() != states ||
      estimate.innovation.size() != residuals || estimate.innovation_std.size() != residuals || !due(group, time))
    return;
  auto topic = group.topics.begin();
  for (const double value : estimate.state) publish(*topic++, time, value);
  for (const faultline_msgs::Quantity& quantity : estimate.quantities) publish(*topic++, time, quantity.value);
  for (std::size_t i = 0; i < residuals; ++i, ++topic)
    if (estimate.innovation_std[i] > 0) publish(*topic, time, estimate.innovation[i] / estimate.innovation_std[i]);
}

}  // namespace faultline

// One topic a number, for tools that plot by topic: plot/channel/NAME, and of each estimator stage
// plot/STAGE/state/NAME, plot/STAGE/quantity/NAME, plot/STAGE/residual/NAME (innovation over its sigma), all
// faultline/Scalar with the sample's stamp. Channels are advertised at once, a stage's with its first estimate. Nothing
// is published that nobody listens to, and no topic more often than `rate` in the samples' time: what happens between
// two points is not seen.
#pragma once

#include <map>
#include <string>
#include <vector>

#include <ros/node_handle.h>

#include "faultline/rig/datasheet.h"
#include "faultline/signal/sample.h"
#include "nodes/messages.h"

namespace faultline {

class PlotTopics {
 public:
  // `rate`: points a second, of the samples' clock.
  PlotTopics(const Datasheet& sheet, double rate);
  void show(const Sample& sample);
  void show(const faultline_msgs::Estimate& estimate);

 private:
  struct Group {  // what one message holds
    std::vector<ros::Publisher> topics;
    double last = -1;  // s, of the last point
  };
  bool due(Group& group, double time) const;
  void publish(const ros::Publisher& topic, double time, double value);

  std::string rig_;
  double period_;
  ros::NodeHandle node_;
  Group channels_;
  std::map<std::string, Group> stages_;
  faultline_msgs::Scalar scalar_;
};

}  // namespace faultline

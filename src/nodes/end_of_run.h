// The end of a run that has a length of its own (a log, a bag, a simulation): the source says on /RIG/end which sample
// was the last, and stays until the alarms are judged up to it. A judgement that takes its time is not lost then
// because the launch ends with its source.
#pragma once

#include <ros/node_handle.h>

#include "nodes/messages.h"

namespace faultline {

class EndOfRun {
 public:
  EndOfRun();
  // `last`: s, stamp of the last sample that was published. Returns when the alarms have come as far, when they get no
  // further for ten seconds (which it warns of), or at once where nobody judges.
  void tell(double last);

 private:
  ros::NodeHandle node_;
  ros::Publisher end_;
  ros::Subscriber alarms_;
  ros::Time judged_;
};

}  // namespace faultline

// Between the core's data and ROS messages: pure functions, no node, no clock.
//
// Time: a stamp holds whole nanoseconds, the core seconds as a double. to_stamp rounds to the nearest nanosecond and
// to_seconds(to_stamp(t)) gives the same double on every further trip, so what a bag holds and what a live node saw are
// the same numbers. At today's epoch seconds a double resolves 0.24 microseconds. Throws InputError for a time that a
// stamp cannot hold: negative, not finite, or past the year 2106.
#pragma once

#include <string>

#include <std_msgs/Time.h>

#include "faultline/alarms/alarm.h"
#include "faultline/estimators/estimate.h"
#include "faultline/estimators/histogram_view.h"
#include "faultline/rig/datasheet.h"
#include "faultline/signal/sample.h"
#include "nodes/description.h"
#include "nodes/messages.h"

namespace faultline {

// What a source says on NAME/end when a run of a length of its own is over: the stamp of its last sample.
std_msgs::Time end_of_run(double last_sample);

ros::Time to_stamp(double seconds);
double to_seconds(const ros::Time& stamp);

faultline_msgs::Sample to_message(const Sample& sample, const std::string& rig);
Sample from_message(const faultline_msgs::Sample& message);

faultline_msgs::RigDescription to_message(const Datasheet& sheet, const std::string& made_by);
Description from_message(const faultline_msgs::RigDescription& message);

// What an estimate leaves unsaid because it is the same for every sample: names, in the order of its vectors.
struct EstimateNames {
  std::string rig;
  std::string stage;
  std::vector<std::string> states;
  std::vector<std::string> channels;  // that the innovation runs over
};
class EstimatorStage;
EstimateNames names_of(const Datasheet& sheet, const EstimatorStage& stage);
faultline_msgs::Estimate to_message(const Estimate& estimate, const EstimateNames& names);
Estimate from_message(const faultline_msgs::Estimate& message);
ChannelStatus to_channel_status(std::uint8_t word);  // InputError where there is none
// `estimate`: of the same stage and sample, which says how far the variable has shifted.
faultline_msgs::Histogram to_message(const HistogramView& view, const EstimateNames& names, const Estimate& estimate);

faultline_msgs::AlarmArray to_message(const AlarmReport& report);
AlarmReport from_message(const faultline_msgs::AlarmArray& message);

// match_channels for a message: where each channel of the datasheet stands in Sample.values. Throws InputError.
std::vector<std::size_t> check_description(const Datasheet& sheet, const faultline_msgs::RigDescription& message);

}  // namespace faultline

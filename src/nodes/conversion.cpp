#include "nodes/conversion.h"

#include <cmath>

#include <fmt/format.h>

#include "faultline/estimators/estimator_stage.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

faultline_msgs::Alarm to_message(const Alarm& alarm) {
  faultline_msgs::Alarm message;
  message.kind = to_string(alarm.kind);
  message.effect = alarm.effect;
  message.port = alarm.port;
  message.level = static_cast<std::uint8_t>(alarm.level);
  message.since = to_stamp(alarm.since);
  message.raised = to_stamp(alarm.raised);
  message.until = to_stamp(alarm.until);
  message.active = alarm.active;
  message.has_size = alarm.has_size;
  message.size_name = alarm.size_name;
  message.size_unit = alarm.size_unit;
  message.size = alarm.size;
  message.size_low = alarm.low;
  message.size_high = alarm.high;
  message.confidence = alarm.confidence;
  message.text = alarm.text;
  message.equivalent = alarm.equivalent;
  return message;
}

Alarm from_message(const faultline_msgs::Alarm& message) {
  if (message.level > static_cast<std::uint8_t>(AlarmLevel::stale))
    throw InputError(fmt::format("alarm level {} is unknown; 0 to 3 are allowed", static_cast<int>(message.level)));
  Alarm alarm;
  alarm.kind = parse_alarm_kind(message.kind, "alarm message");
  alarm.effect = message.effect;
  alarm.port = message.port;
  alarm.level = static_cast<AlarmLevel>(message.level);
  alarm.since = to_seconds(message.since);
  alarm.raised = to_seconds(message.raised);
  alarm.until = to_seconds(message.until);
  alarm.active = message.active != 0;
  alarm.has_size = message.has_size != 0;
  alarm.size_name = message.size_name;
  alarm.size_unit = message.size_unit;
  alarm.size = message.size;
  alarm.low = message.size_low;
  alarm.high = message.size_high;
  alarm.confidence = message.confidence;
  alarm.text = message.text;
  alarm.equivalent = message.equivalent;
  return alarm;
}

faultline_msgs::RankedHypothesis to_message(const RankedHypothesis& hypothesis) {
  faultline_msgs::RankedHypothesis message;
  message.effect = hypothesis.effect;
  message.port = hypothesis.port;
  message.kind = to_string(hypothesis.kind);
  message.size_name = hypothesis.size_name;
  message.size_unit = hypothesis.size_unit;
  message.order = hypothesis.order;
  message.none = hypothesis.none;
  message.full = hypothesis.full;
  message.lowest = hypothesis.lowest;
  message.amplitude = hypothesis.amplitude;
  message.std = hypothesis.std;
  message.evidence = hypothesis.evidence;
  return message;
}

RankedHypothesis from_message(const faultline_msgs::RankedHypothesis& message) {
  RankedHypothesis hypothesis;
  hypothesis.effect = message.effect;
  hypothesis.port = message.port;
  hypothesis.kind = parse_alarm_kind(message.kind, "ranking message");
  hypothesis.size_name = message.size_name;
  hypothesis.size_unit = message.size_unit;
  hypothesis.order = message.order;
  hypothesis.none = message.none;
  hypothesis.full = message.full;
  hypothesis.lowest = message.lowest;
  hypothesis.amplitude = message.amplitude;
  hypothesis.std = message.std;
  hypothesis.evidence = message.evidence;
  return hypothesis;
}

faultline_msgs::Ranking to_message(const Ranking& ranking) {
  faultline_msgs::Ranking message;
  message.since = ranking.since;
  message.judged_until = ranking.judged_until;
  message.threshold = ranking.threshold;
  message.evidence = ranking.evidence;
  message.shows = ranking.shows;
  message.doubt = ranking.doubt;
  message.stuck = ranking.stuck;
  for (const RankedHypothesis& hypothesis : ranking.first) message.first.push_back(to_message(hypothesis));
  for (const RankedHypothesis& hypothesis : ranking.suspected) message.suspected.push_back(to_message(hypothesis));
  for (const RankedHypothesis& hypothesis : ranking.second) message.second.push_back(to_message(hypothesis));
  return message;
}

Ranking from_message(const faultline_msgs::Ranking& message) {
  Ranking ranking;
  ranking.since = message.since;
  ranking.judged_until = message.judged_until;
  ranking.threshold = message.threshold;
  ranking.evidence = message.evidence;
  ranking.shows = message.shows != 0;
  ranking.doubt = message.doubt;
  ranking.stuck = message.stuck;
  for (const auto& hypothesis : message.first) ranking.first.push_back(from_message(hypothesis));
  for (const auto& hypothesis : message.suspected) ranking.suspected.push_back(from_message(hypothesis));
  for (const auto& hypothesis : message.second) ranking.second.push_back(from_message(hypothesis));
  return ranking;
}

}  // namespace

ros::Time to_stamp(double seconds) {
  if (!(seconds >= 0) || seconds >= 4294967295.0)
    throw InputError(
        fmt::format("time {} s does not fit a ROS stamp; 0 to 4294967294 s after the epoch is allowed", seconds));
  double whole = std::floor(seconds);
  double nanoseconds = std::round((seconds - whole) * 1e9);
  if (nanoseconds >= 1e9) {
    nanoseconds -= 1e9;
    whole += 1;
  }
  return ros::Time(static_cast<std::uint32_t>(whole), static_cast<std::uint32_t>(nanoseconds));
}

std_msgs::Time end_of_run(double last_sample) {
  std_msgs::Time message;
  message.data = to_stamp(last_sample);
  return message;
}

double to_seconds(const ros::Time& stamp) { return stamp.toSec(); }

faultline_msgs::Sample to_message(const Sample& sample, const std::string& rig) {
  faultline_msgs::Sample message;
  message.header.stamp = to_stamp(sample.time);
  message.header.frame_id = rig;
  message.sequence = sample.sequence;
  message.values = sample.values;
  return message;
}

Sample from_message(const faultline_msgs::Sample& message) {
  Sample sample;
  sample.time = to_seconds(message.header.stamp);
  sample.sequence = message.sequence;
  sample.values = message.values;
  return sample;
}

faultline_msgs::RigDescription to_message(const Datasheet& sheet, const std::string& made_by) {
  faultline_msgs::RigDescription message;
  message.header.frame_id = sheet.rig;
  message.rig = sheet.rig;
  message.sample_period = sheet.sample_period;
  message.made_by = made_by;
  for (const Channel& channel : sheet.channels) {
    faultline_msgs::ChannelDescription entry;
    entry.name = channel.name;
    entry.unit = channel.unit;
    entry.role = to_string(channel.role);
    message.channels.push_back(entry);
  }
  return message;
}

Description from_message(const faultline_msgs::RigDescription& message) {
  Description description;
  description.rig = message.rig;
  description.sample_period = message.sample_period;
  description.made_by = message.made_by;
  description.start = to_seconds(message.header.stamp);
  for (const faultline_msgs::ChannelDescription& channel : message.channels) {
    description.names.push_back(channel.name);
    description.units.push_back(channel.unit);
  }
  return description;
}

EstimateNames names_of(const Datasheet& sheet, const EstimatorStage& stage) {
  EstimateNames names;
  names.rig = sheet.rig;
  names.stage = stage.name();
  for (const State& state : stage.states()) names.states.push_back(state.name);
  names.channels = stage.innovation_names();
  return names;
}

faultline_msgs::Estimate to_message(const Estimate& estimate, const EstimateNames& names) {
  faultline_msgs::Estimate message;
  message.header.stamp = to_stamp(estimate.time);
  message.header.frame_id = names.rig;
  message.sequence = estimate.sequence;
  message.stage = names.stage;
  message.restarted = estimate.restarted;
  message.state_names = names.states;
  message.state = estimate.state;
  message.covariance = estimate.covariance;
  message.channel_names = names.channels;
  message.innovation = estimate.innovation;
  message.innovation_std = estimate.innovation_std;
  message.normalised_innovation = estimate.normalised_innovation;
  message.observed = static_cast<std::uint32_t>(estimate.observed);
  message.channel_status.reserve(estimate.channel_status.size());
  for (const ChannelStatus status : estimate.channel_status)
    message.channel_status.push_back(static_cast<std::uint8_t>(status));
  message.quantities.resize(estimate.quantities.size());
  for (std::size_t i = 0; i < estimate.quantities.size(); ++i) {
    message.quantities[i].name = estimate.quantities[i].name;
    message.quantities[i].unit = estimate.quantities[i].unit;
    message.quantities[i].value = estimate.quantities[i].value;
    message.quantities[i].std = estimate.quantities[i].std;
  }
  if (estimate.ranking) message.ranking.push_back(to_message(*estimate.ranking));
  return message;
}

ChannelStatus to_channel_status(std::uint8_t word) {
  if (word > static_cast<std::uint8_t>(ChannelStatus::last))
    throw InputError(fmt::format("channel status {} is unknown; 0 to {} are allowed", static_cast<int>(word),
                                 static_cast<int>(ChannelStatus::last)));
  return static_cast<ChannelStatus>(word);
}

Estimate from_message(const faultline_msgs::Estimate& message) {
  Estimate estimate;
  estimate.time = to_seconds(message.header.stamp);
  estimate.sequence = message.sequence;
  estimate.restarted = message.restarted != 0;
  estimate.state = message.state;
  estimate.covariance = message.covariance;
  estimate.innovation = message.innovation;
  estimate.innovation_std = message.innovation_std;
  estimate.normalised_innovation = message.normalised_innovation;
  estimate.observed = static_cast<int>(message.observed);
  estimate.channel_status.reserve(message.channel_status.size());
  for (const std::uint8_t status : message.channel_status) estimate.channel_status.push_back(to_channel_status(status));
  for (const faultline_msgs::Quantity& quantity : message.quantities)
    estimate.quantities.push_back({quantity.name, quantity.unit, quantity.value, quantity.std});
  if (message.ranking.size() > 1)
    throw InputError(fmt::format("an estimate has {} rankings; one or none is allowed", message.ranking.size()));
  if (!message.ranking.empty())
    estimate.ranking = std::make_shared<const Ranking>(from_message(message.ranking.front()));
  return estimate;
}

faultline_msgs::Histogram to_message(const HistogramView& view, const EstimateNames& names, const Estimate& estimate) {
  const auto told = [&estimate](const std::string& name) {
    for (const Quantity& quantity : estimate.quantities)
      if (quantity.name == name) return quantity.value;
    throw InputError(fmt::format("an estimate beside histograms lacks the quantity '{}'", name));
  };
  faultline_msgs::Histogram message;
  message.header.stamp = to_stamp(estimate.time);
  message.header.frame_id = message.rig = names.rig;
  message.stage = names.stage;
  message.variable = view.variable;
  message.unit = view.unit;
  for (const HistogramAxis& axis : view.axes) {
    message.axes.push_back(axis.variable);
    message.axis_units.push_back(axis.unit);
    message.axis_low.push_back(axis.low);
    message.axis_high.push_back(axis.high);
    message.axis_bins.push_back(static_cast<std::uint32_t>(axis.bins));
  }
  message.sections = static_cast<std::uint32_t>(view.sections);
  message.population = view.population;
  message.start = view.start;
  message.width = view.width;
  message.mean = view.mean;
  message.low = view.low;
  message.high = view.high;
  for (const double count : view.counts) message.counts.push_back(static_cast<float>(count));
  message.bin = view.bin;
  message.value = view.value;
  message.average = view.average;
  message.above = view.above;
  message.below = view.below;
  message.level = told(view.variable + ".level");
  message.judging = told("judging") > 0;
  return message;
}

faultline_msgs::AlarmArray to_message(const AlarmReport& report) {
  faultline_msgs::AlarmArray message;
  message.header.stamp = to_stamp(report.time);
  message.header.frame_id = report.rig;
  message.rig = report.rig;
  message.verdict = report.verdict;
  message.judged = report.judged;
  for (const Alarm& alarm : report.alarms) message.alarms.push_back(to_message(alarm));
  return message;
}

AlarmReport from_message(const faultline_msgs::AlarmArray& message) {
  AlarmReport report;
  report.rig = message.rig;
  report.time = to_seconds(message.header.stamp);
  report.verdict = message.verdict;
  report.judged = message.judged != 0;
  for (const faultline_msgs::Alarm& alarm : message.alarms) report.alarms.push_back(from_message(alarm));
  return report;
}

std::vector<std::size_t> check_description(const Datasheet& sheet, const faultline_msgs::RigDescription& message) {
  return match_channels(sheet, from_message(message));
}

}  // namespace faultline

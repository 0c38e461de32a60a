#include "nodes/view_publisher.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <ros/ros.h>

#include "nodes/conversion.h"
#include "nodes/node_main.h"

namespace faultline {
namespace {

constexpr double kDrawPeriod = 0.25;  // s of wall time
// s of wall time without an estimate, after which samples are listened to all the same, and move the parts. A player
// that waits for subscribers of the samples is to wait for the estimators, not for a drawing; and estimators may think.
constexpr double kPatience = 5;
constexpr double kResend = 1;        // s of wall time
constexpr double kResidualTime = 1;  // s, of the mean square
constexpr double kAlarmsFresh = 5;   // s of wall time; they come once a second
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

}  // namespace

ViewPublisher::ViewPublisher(const Datasheet& sheet, const ViewLayout& layout, double frame_rate, double plot_rate)
    : sheet_(sheet),
      layout_(layout),
      space_(ros::this_node::getNamespace().size() > 1 ? ros::this_node::getNamespace().substr(1) : sheet.rig),
      frame_period_(1 / frame_rate),
      plots_(sheet, plot_rate),
      channels_(sheet.channels.size(), kNaN),
      began_(steady_seconds()),
      input_(sheet, [this](const Sample& sample) { take(sample); }),
      health_(sheet.rig, "view", [this](diagnostic_updater::DiagnosticStatusWrapper& status) { tell(status); }) {
  markers_ = node_.advertise<visualization_msgs::MarkerArray>("view", 10);
  const ViewValues unmoved = values();
  std::vector<geometry_msgs::TransformStamped> still;
  for (std::size_t i = 0; i < layout_.parts.size(); ++i)
    if (!moves(layout_.parts[i])) still.push_back(frame_of(layout_, i, unmoved, space_));
  static_broadcaster_.sendTransform(still);
  move(0);  // so that everything stands somewhere before the first sample
  const ros::TransportHints fast = ros::TransportHints().tcpNoDelay();
  estimates_subscriber_ = node_.subscribe<faultline_msgs::Estimate>(
      "estimate", kQueue, [this](const faultline_msgs::Estimate::ConstPtr& message) { take(message); },
      ros::VoidConstPtr(), fast);
  alarms_subscriber_ = node_.subscribe<faultline_msgs::AlarmArray>(
      "alarms", 100, [this](const faultline_msgs::AlarmArray::ConstPtr& message) {
        alarms_ = message;
        alarms_at_ = steady_seconds();
      });
  gap_subscriber_ = node_.subscribe<faultline_msgs::Gap>(
      "gap", 100, [this](const faultline_msgs::Gap::ConstPtr& message) { gap_ = message; });
  draw_timer_ = node_.createWallTimer(ros::WallDuration(kDrawPeriod), [this](const ros::WallTimerEvent&) { draw(); });
}

void ViewPublisher::take(const Sample& sample) {
  if (sample.time < sample_time_) moved_ = -1;  // a run that begins anew
  sample_time_ = sample.time;
  heard_at_ = steady_seconds();
  channels_ = sample.values;
  plots_.show(sample);
  if (!estimates_come()) move(sample.time);
}

void ViewPublisher::take(const faultline_msgs::Estimate::ConstPtr& message) {
  const double time = to_seconds(message->header.stamp);
  heard_at_ = steady_seconds();
  estimates_[message->stage] = message;
  look_at_residuals(*message, time);
  plots_.show(*message);
  const auto known = carries_.find(message->stage);
  if (known == carries_.end() ? (carries_[message->stage] = carries(*message)) : known->second) {
    estimate_at_ = steady_seconds();
    if (message->restarted) moved_ = -1;
    move(time);
  }
}

bool ViewPublisher::carries(const faultline_msgs::Estimate& estimate) const {
  const std::vector<std::string>& names = estimate.state_names;
  return std::any_of(layout_.parts.begin(), layout_.parts.end(), [&](const ViewPart& part) {
    return std::find(names.begin(), names.end(), part.moves.name) != names.end() ||
           std::find(names.begin(), names.end(), part.turns.name) != names.end();
  });
}

void ViewPublisher::look_at_residuals(const faultline_msgs::Estimate& estimate, double time) {
  Residuals& residuals = residuals_[estimate.stage];
  const std::size_t rows = std::min(estimate.innovation.size(), estimate.innovation_std.size());
  if (estimate.restarted || residuals.mean_squares.size() != rows) {
    residuals.mean_squares.assign(rows, 0);
    residuals.time = time;
  }
  const double share = 1 - std::exp(-std::max(0.0, time - residuals.time) / kResidualTime);
  residuals.time = time;
  for (std::size_t i = 0; i < rows; ++i) {
    if (estimate.innovation_std[i] <= 0) continue;
    const double ratio = estimate.innovation[i] / estimate.innovation_std[i];
    if (std::isfinite(ratio)) residuals.mean_squares[i] += share * (ratio * ratio - residuals.mean_squares[i]);
  }
}

// Samples run ahead of estimates: which of them moves the parts must not change from one to the next.
bool ViewPublisher::estimates_come() const {
  return estimate_at_ >= 0 && steady_seconds() - estimate_at_ < std::max(kPatience, 3 * sheet_.sample_period);
}

double ViewPublisher::value_of(const ViewSource& source) const {
  if (source.name.empty()) return kNaN;
  if (estimates_come())
    for (const StageSpec& stage : sheet_.estimators) {
      const auto found = estimates_.find(stage.name);
      if (found == estimates_.end()) continue;
      const std::vector<std::string>& names = found->second->state_names;
      const auto state = static_cast<std::size_t>(std::find(names.begin(), names.end(), source.name) - names.begin());
      if (state < found->second->state.size()) return found->second->state[state];
    }
  return source.channel < 0 ? kNaN : channels_[static_cast<std::size_t>(source.channel)];
}

ViewValues ViewPublisher::values() const {
  ViewValues found;
  found.channels = channels_;
  for (const ViewPart& part : layout_.parts) {
    found.moves.push_back(value_of(part.moves));
    found.turns.push_back(value_of(part.turns));
    found.flows.push_back(value_of(part.flow));
  }
  return found;
}

void ViewPublisher::move(double time) {
  if (moved_ >= 0 && time < moved_ + frame_period_) return;
  moved_ = time;
  ++frames_;
  resent_ = 0;
  send_frames(to_stamp(time));
}

void ViewPublisher::send_frames(const ros::Time& stamp) {
  sent_at_ = steady_seconds();
  const ViewValues now = values();
  std::vector<geometry_msgs::TransformStamped> moving;
  for (std::size_t i = 0; i < layout_.parts.size(); ++i) {
    if (!moves(layout_.parts[i])) continue;
    moving.push_back(frame_of(layout_, i, now, space_));
    moving.back().header.stamp = stamp;
  }
  if (!moving.empty()) broadcaster_.sendTransform(moving);
}

std::vector<ResidualBar> ViewPublisher::bars() const {
  std::vector<ResidualBar> found;
  for (const StageSpec& stage : sheet_.estimators) {
    const auto estimate = estimates_.find(stage.name);
    const auto residuals = residuals_.find(stage.name);
    if (estimate == estimates_.end() || residuals == residuals_.end()) continue;
    for (std::size_t i = 0; i < residuals->second.mean_squares.size(); ++i) {
      const std::string& name = estimate->second->channel_names[i];
      if (residuals->second.mean_squares[i] > 0 &&
          std::none_of(found.begin(), found.end(), [&](const ResidualBar& bar) { return bar.channel == name; }))
        found.push_back({name, std::sqrt(residuals->second.mean_squares[i])});
    }
  }
  return found;
}

ViewHead ViewPublisher::head() const {
  ViewHead head;
  const double now = steady_seconds();
  if (!alarms_ || now - alarms_at_ > kAlarmsFresh) {
    head.verdict = alarms_ ? fmt::format("Not judged: no word of the alarm node for {:.0f} s.", now - alarms_at_)
                           : "Not judged: no alarm node is heard.";
  } else {
    head.verdict = alarms_->verdict;
    head.level = heard_at_ < 0 ? PartLevel::unjudged : level_of(*alarms_);
  }
  if (gap_) head.gap = gap_->text;
  return head;
}

void ViewPublisher::draw() {
  if (!listening_ && (!estimates_.empty() || steady_seconds() - began_ > kPatience)) {
    input_.start();
    listening_ = true;
  }
  // Whoever begins to look while nothing moves must find the parts, too; no stamp is sent twice.
  if (steady_seconds() - sent_at_ > kResend)
    send_frames(to_stamp(std::max(moved_, 0.0)) + ros::Duration().fromNSec(++resent_));
  if (markers_.getNumSubscribers() == 0) return;
  const bool judged = alarms_ && steady_seconds() - alarms_at_ <= kAlarmsFresh && heard_at_ >= 0;
  const Judgements heard{judged ? alarms_.get() : nullptr, gap_.get()};
  markers_.publish(markers_of(layout_, sheet_, part_marks(layout_, sheet_, heard), values(), head(), bars(), space_));
}

void ViewPublisher::tell(diagnostic_updater::DiagnosticStatusWrapper& status) {
  input_.tell(status);
  status.add("layout", layout_.file.empty() ? "generated" : layout_.file);
  status.add("frames", frames_);
}

}  // namespace faultline

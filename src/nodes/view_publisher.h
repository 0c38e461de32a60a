// A rig's drawing while it runs: /RIG/sample, /RIG/estimate, /RIG/alarms and /RIG/gap in; /tf, /tf_static, /RIG/view
// (markers, four times a second of wall time while somebody looks) and the topics of plot_topics.h out. Frames have the
// stamps of the samples. Parts move with the estimate; while none has come for 5 s, with the sample.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <ros/node_handle.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <tf2_ros/transform_broadcaster.h>

#include "nodes/plot_topics.h"
#include "nodes/rig_input.h"
#include "nodes/view_markers.h"

namespace faultline {

class ViewPublisher {
 public:
  // `frame_rate`, `plot_rate`: at most so many frames and points a second of the samples' time.
  ViewPublisher(const Datasheet& sheet, const ViewLayout& layout, double frame_rate, double plot_rate);

 private:
  void take(const Sample& sample);
  void take(const faultline_msgs::Estimate::ConstPtr& message);
  void look_at_residuals(const faultline_msgs::Estimate& estimate, double time);
  void move(double time);
  void send_frames(const ros::Time& stamp);
  void draw();
  ViewValues values() const;
  double value_of(const ViewSource& source) const;
  bool carries(const faultline_msgs::Estimate& estimate) const;
  bool estimates_come() const;
  std::vector<ResidualBar> bars() const;
  ViewHead head() const;
  void tell(diagnostic_updater::DiagnosticStatusWrapper& status);

  struct Residuals {
    std::vector<double> mean_squares;
    double time = -1;  // s
  };

  const Datasheet& sheet_;
  const ViewLayout& layout_;
  std::string space_;
  double frame_period_;
  PlotTopics plots_;
  std::vector<double> channels_;
  double sample_time_ = -1, moved_ = -1;   // s, of the samples' clock
  double estimate_at_ = -1;                // s, steady: when the last estimate with a state that moves a part came
  double alarms_at_ = -1, heard_at_ = -1;  // s, steady
  std::map<std::string, faultline_msgs::Estimate::ConstPtr> estimates_;  // by stage
  std::map<std::string, Residuals> residuals_;                           // likewise
  std::map<std::string, bool> carries_;                                  // likewise: has a state that moves a part
  faultline_msgs::AlarmArray::ConstPtr alarms_;
  faultline_msgs::Gap::ConstPtr gap_;
  std::uint64_t frames_ = 0;
  double sent_at_ = 0;       // s, steady: the last frames
  std::int64_t resent_ = 0;  // times that they were sent again
  ros::NodeHandle node_;
  tf2_ros::TransformBroadcaster broadcaster_;
  tf2_ros::StaticTransformBroadcaster static_broadcaster_;
  ros::Publisher markers_;
  ros::Subscriber estimates_subscriber_, alarms_subscriber_, gap_subscriber_;
  ros::WallTimer draw_timer_;
  double began_;  // s, steady
  bool listening_ = false;
  RigInput input_;
  NodeHealth health_;
};

}  // namespace faultline

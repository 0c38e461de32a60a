// Hosts one estimator stage of a rig: /RIG/sample in, /RIG/estimate out, the service ~reset. Only header stamps matter:
// the same stage fed offline with the same samples gives the same estimates.
#pragma once

#include <functional>
#include <string>

#include <ros/node_handle.h>
#include <std_srvs/Trigger.h>

#include "faultline/estimators/estimator_stage.h"
#include "nodes/conversion.h"
#include "nodes/node_health.h"
#include "nodes/rig_input.h"

namespace faultline {

class EstimatorHost {
 public:
  // `stage`: of the datasheet's estimators; empty: its first. Throws InputError that lists the stages there are.
  EstimatorHost(const Datasheet& sheet, const std::string& stage);
  // Subscribes once /RIG/estimate has `wait_for` subscribers, so that they miss nothing.
  void start(int wait_for);

 private:
  void take(const Sample& sample);
  bool reset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response);
  void tell(diagnostic_updater::DiagnosticStatusWrapper& status);

  const Datasheet& sheet_;
  EstimatorStage stage_;
  EstimateNames names_;
  Estimate estimate_;
  ros::NodeHandle node_, private_node_;
  ros::Publisher estimates_;
  ros::ServiceServer service_;
  RigInput input_;
  NodeHealth health_;
};

}  // namespace faultline

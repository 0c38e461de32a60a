// Hosts the estimator stages of some families of a rig: /RIG/sample in, /RIG/estimate out (one message a stage and
// sample), the service ~reset. Only header stamps matter: the same stages fed offline with the same samples give the
// same estimates. Which types there are, and of which family, the types themselves say (estimators/estimator.h).
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <ros/node_handle.h>
#include <std_srvs/Trigger.h>

#include "faultline/estimators/estimator_stage.h"
#include "nodes/conversion.h"
#include "nodes/node_health.h"
#include "nodes/node_main.h"
#include "nodes/rig_input.h"

namespace faultline {

class EstimatorHost {
 public:
  // Waits for the listeners to its estimates before it subscribes. `stage`: of the datasheet's estimators of these
  // families; empty: all of them. Throws InputError that lists the
  // stages there are.
  EstimatorHost(const Datasheet& sheet, const std::vector<std::string>& families, const std::string& stage,
                Listeners listeners);

 private:
  void take(const Sample& sample);
  bool reset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response);
  void tell(diagnostic_updater::DiagnosticStatusWrapper& status);

  const Datasheet& sheet_;
  struct Hosted {
    EstimatorStage stage;
    EstimateNames names;
    Estimate estimate;
    bool occasional;  // only news is told
    bool due;
  };
  std::vector<Hosted> hosted_;
  ros::NodeHandle node_, private_node_;
  ros::Publisher estimates_;
  ros::ServiceServer service_;
  RigInput input_;
  NodeHealth health_;
};

// The whole of a node: parameters, host, spin.
int run_estimator_node(int argc, char** argv, const std::string& name, const std::vector<std::string>& families);

}  // namespace faultline

// Hosts the estimator stages of some families of a rig: /RIG/sample in, /RIG/estimate out (one message a stage and
// sample), the service ~reset. Of stages that learn histograms, /RIG/histogram (one message a variable and second).
// Only header stamps matter: the same stages fed offline with the same samples give the same estimates.
// Which types there are, and of which family, the types themselves say (estimators/estimator.h).
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
  // families; empty: all of them. `reference`: a file of what they learnt, from which they go on if it is there, and
  // which is written while they learn and in the end; empty: none. Throws InputError that lists the stages there are,
  // or where the file is refused.
  EstimatorHost(const Datasheet& sheet, const std::vector<std::string>& families, const std::string& stage,
                const std::string& reference, Listeners listeners);
  ~EstimatorHost();

 private:
  void take(const Sample& sample);
  bool reset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response);
  void tell(diagnostic_updater::DiagnosticStatusWrapper& status);
  void publish_histograms();
  void keep_reference();

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
  ros::Publisher estimates_, histograms_;
  ros::WallTimer histogram_timer_, reference_timer_;
  std::string reference_, reference_trouble_;
  ros::ServiceServer service_;
  RigInput input_;
  NodeHealth health_;
};

// The whole of a node: parameters, host, spin.
int run_estimator_node(int argc, char** argv, const std::string& name, const std::vector<std::string>& families);

}  // namespace faultline

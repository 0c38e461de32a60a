// parameter_node: samples -> estimates, by recursive least squares. Parameters, topics and services:
// docs/nodes.md.
#include <ros/ros.h>

#include "nodes/estimator_host.h"
#include "nodes/node_main.h"

int main(int argc, char** argv) {
  using namespace faultline;
  return run_node(argc, argv, "parameter_node", [](Parameters& parameters) {
    const Datasheet sheet = read_rig(parameters);
    const std::string stage = parameters.word("stage", "");
    const int wait_for = static_cast<int>(parameters.integer("wait_for", 0, 0, 100));
    parameters.check_used();
    EstimatorHost node(sheet, EstimatorFamily::least_squares, stage);
    node.start(wait_for);
    ros::spin();
    return 0;
  });
}

// gap_node: the nominal model beside the live rig. Samples -> /RIG/gap and /diagnostics. Parameters and topics:
// docs/nodes.md.
#include <ros/ros.h>

#include "faultline/signal/error.h"
#include "nodes/gap_publisher.h"
#include "nodes/node_main.h"

int main(int argc, char** argv) {
  using namespace faultline;
  return run_node(argc, argv, "gap_node", [](Parameters& parameters) {
    const Datasheet sheet = read_rig(parameters);
    parameters.check_used();
    GapPublisher publisher(sheet);
    publisher.start();
    ros::spin();
    if (!publisher.refusal().empty()) throw InputError(publisher.refusal());
    return 0;
  });
}

// gap_node: the nominal model beside the live rig. Samples -> /RIG/gap and /diagnostics. Parameters and topics:
// docs/nodes.md.
#include <algorithm>
#include <thread>

#include <ros/ros.h>

#include "faultline/gap/normal_gap.h"
#include "nodes/gap_publisher.h"
#include "nodes/node_main.h"

int main(int argc, char** argv) {
  using namespace faultline;
  return run_node(argc, argv, "gap_node", [](Parameters& parameters) {
    Datasheet sheet = read_rig(parameters);
    parameters.check_used();
    if (sheet.normal_gap.empty()) {
      ROS_INFO("%s: the datasheet has no normal_gap; taking it from simulations within the tolerances",
               sheet.rig.c_str());
      const int jobs = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
      sheet.normal_gap = simulated_normal_gap(sheet, LiveGapSettings(), jobs);
    }
    GapPublisher publisher(sheet);
    publisher.start();
    ros::spin();
    return 0;
  });
}

// view_node: a rig as a drawing for rviz, and a topic for each number for plots. Parameters and topics: docs/nodes.md.
#include <ros/ros.h>

#include "nodes/node_main.h"
#include "nodes/view_publisher.h"

int main(int argc, char** argv) {
  using namespace faultline;
  return run_node(argc, argv, "view_node", [](Parameters& parameters) {
    const Datasheet sheet = read_rig(parameters);
    const double frame_rate = parameters.number("frame_rate", 25, 0.1, 200);
    const double plot_rate = parameters.number("plot_rate", 50, 0.1, 10000);
    parameters.check_used();
    const ViewLayout layout = view_layout(sheet);
    ViewPublisher publisher(sheet, layout, frame_rate, plot_rate);
    ros::spin();
    return 0;
  });
}

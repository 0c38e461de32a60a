// alarm_node: what detectors and isolators say -> alarms and /diagnostics. Parameters and topics: docs/nodes.md.
#include <fmt/format.h>
#include <ros/ros.h>

#include "faultline/signal/error.h"
#include "nodes/alarm_publisher.h"
#include "nodes/node_main.h"

int main(int argc, char** argv) {
  using namespace faultline;
  return run_node(argc, argv, "alarm_node", [](Parameters& parameters) {
    const Datasheet sheet = read_rig(parameters);
    if (sheet.estimators.empty())
      throw InputError(
          fmt::format("{}: the datasheet names no estimator; this rig cannot be diagnosed yet", sheet.file));
    const double patience = parameters.number("patience", 0.5, 0, 60);
    const std::string history = parameters.bytes("history");
    parameters.check_used();
    AlarmPublisher publisher(sheet, patience, history);
    ros::spin();
    return 0;
  });
}

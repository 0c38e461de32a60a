// isolator_node: estimates -> what detectors and isolators say. Parameters and topics: docs/nodes.md.
#include <fmt/format.h>
#include <ros/ros.h>

#include "faultline/signal/error.h"
#include "nodes/isolation_host.h"
#include "nodes/node_main.h"

int main(int argc, char** argv) {
  using namespace faultline;
  return run_node(argc, argv, "isolator_node", [](Parameters& parameters) {
    const Datasheet sheet = read_rig(parameters);
    if (sheet.estimators.empty())
      throw InputError(
          fmt::format("{}: the datasheet names no estimator; this rig cannot be diagnosed yet", sheet.file));
    const std::string reference = parameters.word("reference", "");
    Listeners listeners(parameters);
    parameters.check_used();
    const IsolationHost host(sheet, reference, std::move(listeners));
    ros::spin();
    return 0;
  });
}

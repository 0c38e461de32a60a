// alarm_node: what detectors and isolators say -> alarms and /diagnostics. Parameters and topics: docs/nodes.md.
#include <csignal>

#include <fmt/format.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>

#include "faultline/signal/error.h"
#include "nodes/alarm_publisher.h"
#include "nodes/node_main.h"

namespace {

volatile std::sig_atomic_t ended = 0;

void end(int) { ended = 1; }

}  // namespace

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
    // In place of roscpp's: it takes the topics away before anything could be said on them.
    for (const int number : {SIGINT, SIGTERM}) std::signal(number, end);
    while (ros::ok() && ended == 0) ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.1));
    publisher.close();
    return 0;
  });
}

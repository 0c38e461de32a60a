// rig_driver_node: LCM, a log of it, or a stand's own topics by a mapping -> /RIG/sample. Parameters, topics and LCM
// channels: docs/nodes.md.
#include <fmt/format.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>

#include "faultline/rig/mapping.h"
#include "faultline/signal/error.h"
#include "nodes/end_of_run.h"
#include "nodes/lcm_name.h"
#include "nodes/lcm_source.h"
#include "nodes/node_main.h"
#include "nodes/rig_driver.h"
#include "nodes/topic_driver.h"

namespace faultline {
namespace {

// s: topics of one machine arrive within milliseconds of each other, over a network within some ten.
constexpr double kTopicWait = 0.1;

int drive_topics(const Datasheet& sheet, const std::string& file, double wait, Listeners& listeners) {
  const Mapping mapping = read_mapping(file, sheet);
  check_topics(mapping);
  Datasheet described = sheet;
  described.sample_period = mapping.period;
  TopicDriver driver(described, mapping, "rig_driver_node: topics by " + file, wait, listeners);
  const NodeHealth health(sheet.rig, "driver",
                          [&](diagnostic_updater::DiagnosticStatusWrapper& status) { driver.tell(status); });
  listeners.wait();
  driver.start();
  while (ros::ok() && !driver.ended()) ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.05));
  if (ros::ok() && !driver.trouble().empty()) throw InputError(driver.trouble());
  return 0;
}

int drive(Parameters& parameters) {
  const Datasheet sheet = read_rig(parameters);
  const std::string url = parameters.word("lcm_url", "");
  const std::string log = parameters.word("log", "");
  const std::string given_name = read_lcm_name(parameters);
  const std::string mapping = parameters.word("mapping", "");
  const double wait = parameters.number("wait", kTopicWait, 0, 60);
  const double rate = parameters.number("rate", 1, 0.01, 100);
  Listeners listeners(parameters);
  parameters.check_used();
  if (!log.empty() && !url.empty()) throw InputError("parameters ~log and ~lcm_url exclude each other; give one");
  if (!mapping.empty()) {
    if (!log.empty() || !url.empty())
      throw InputError("parameters ~mapping, ~log and ~lcm_url exclude each other; give one");
    if (!given_name.empty()) throw InputError("parameters ~mapping and ~lcm_name exclude each other; give one");
    return drive_topics(sheet, mapping, wait, listeners);
  }

  const std::string live_name = given_name.empty() ? sheet.rig : given_name;
  const std::string name = log.empty() ? live_name : find_lcm_name(log, sheet.rig, given_name);
  RigDriver driver(
      sheet, name,
      "rig_driver_node: " + (log.empty() ? "LCM " + (url.empty() ? "default network" : url) : "LCM log " + log),
      listeners);
  const NodeHealth health(sheet.rig, "driver",
                          [&](diagnostic_updater::DiagnosticStatusWrapper& status) { driver.tell(status); });
  const LcmSource::Take take = [&](const std::string& channel, const void* data, int size, double arrival) {
    driver.take(channel, data, size, arrival);
  };
  const LcmSource::Idle idle = [&](double now) { driver.flush(now); };

  LcmSource source;
  // A DAQ does not wait, but what the driver hears is then heard by all: diagnosis and recorder begin with one sample.
  listeners.wait();
  if (log.empty())
    source.listen(url, name, take, idle);
  else
    source.play(log, rate, take, idle);
  while (ros::ok() && !source.ended()) ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.05));
  if (!source.ended()) return 0;  // stopped from outside
  if (driver.published() > 0) EndOfRun().tell(driver.last_time());
  if (!source.trouble().empty()) throw InputError(source.trouble());
  if (driver.published() == 0)
    throw InputError(fmt::format("{}: no sample of the rig '{}' in it{}", log, sheet.rig,
                                 driver.trouble().empty() ? "" : ": " + driver.trouble()));
  return 0;
}

}  // namespace
}  // namespace faultline

int main(int argc, char** argv) { return faultline::run_node(argc, argv, "rig_driver_node", faultline::drive); }

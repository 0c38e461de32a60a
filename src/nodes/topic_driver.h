// From a stand's own topics to /RIG/sample, as a mapping (rig/mapping.h) says. The topics are read by a child process
// (field_reader.h), in a thread of this object, so that no ROS callback waits for it; rows are assembled as
// `faultline import` does from a recording, by header stamps where there are some. A topic that falls silent leaves its
// channel without a value, and all of them silent leave no sample: nothing is invented. Stamps that jump back (a bag
// that begins again) begin anew.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <diagnostic_updater/DiagnosticStatusWrapper.h>
#include <ros/node_handle.h>

#include "faultline/rig/mapping.h"
#include "faultline/signal/sample.h"
#include "faultline/signal/sample_check.h"
#include "faultline/signal/sequence_monitor.h"
#include "nodes/field_reader.h"
#include "nodes/node_health.h"
#include "nodes/node_main.h"

namespace faultline {

class TopicDriver {
 public:
  // Advertises, and publishes the latched description. `wait`: s, in the stamps of the topics, that a row waits for one
  // that is behind the others.
  TopicDriver(const Datasheet& sheet, const Mapping& mapping, const std::string& made_by, double wait,
              Listeners& listeners);
  ~TopicDriver();

  void tell(diagnostic_updater::DiagnosticStatusWrapper& status);
  void start();
  bool ended() const { return ended_; }
  std::string trouble() const;  // why it ended

 private:
  void listen();
  void take(std::size_t signal, double time, double raw);
  void deliver(double time, std::uint64_t row, const std::vector<double>& values);

  const Datasheet& sheet_;
  const Mapping& mapping_;
  ros::NodeHandle node_;
  ros::Publisher samples_, description_;
  std::vector<Conversion> conversions_;
  std::thread thread_;
  std::atomic<bool> stop_{false}, ended_{false};
  mutable std::mutex mutex_;  // over all that follows
  RowAssembler assembler_;
  SequenceMonitor monitor_;
  SampleCheck check_;  // of the period
  SequenceCounts told_;
  RateMeter rate_;
  Sample sample_;
  std::string note_, trouble_;
  std::uint64_t values_ = 0, refused_ = 0, late_ = 0, missing_ = 0, missing_told_ = 0, restarts_ = 0;
};

}  // namespace faultline

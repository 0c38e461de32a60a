// What an alarm node told before it died and was started again in the same launch. It is kept at the ROS master, which
// outlives the node, as the node's private parameter ~history (bytes of a faultline/AlarmArray); a new launch clears
// it. The estimators' own state is not kept: what still holds is found again.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "faultline/alarms/alarm.h"

namespace faultline {

class AlarmBefore {
 public:
  // `kept`: bytes of ~history, empty where there are none. What cannot be read, or is another rig's, is left out with
  // a warning: it must not keep the node from its work.
  AlarmBefore(const std::string& rig, const std::string& kept);

  // Alarms of before, all of them over, and then what is told now. Forgotten where the samples' time jumped back behind
  // them: another run.
  AlarmReport with(AlarmReport now);

 private:
  std::vector<Alarm> alarms_;
  double time_ = 0;  // s, of the last sample before
};

// The bytes of the latest alarms of a report.
std::vector<std::uint8_t> to_bytes(AlarmReport report);

}  // namespace faultline

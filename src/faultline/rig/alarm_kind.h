// What kind of trouble an alarm tells of. Words stand at the edge only: datasheets, ROS messages, JSON.
#pragma once

#include <string>

namespace faultline {

// From the worst to the mildest.
enum class AlarmKind {
  fault,    // of the rig
  sensor,   // of a transducer or its converter
  model,    // an innovation that should be white is not
  unknown,  // something is off and no cause is named
  data      // samples are missing, out of range or late
};

const char* to_string(AlarmKind kind);
// InputError that begins with `where` and lists the words there are.
AlarmKind parse_alarm_kind(const std::string& word, const std::string& where);

}  // namespace faultline

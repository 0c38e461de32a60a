#include "faultline/signal/channel.h"

namespace faultline {

int find_channel(const std::vector<Channel>& channels, const std::string& name) {
  for (std::size_t i = 0; i < channels.size(); ++i)
    if (channels[i].name == name) return static_cast<int>(i);
  return -1;
}

std::string to_string(Role role) {
  switch (role) {
    case Role::setpoint:
      return "setpoint";
    case Role::command:
      return "command";
    case Role::input:
      return "input";
    case Role::output:
      return "output";
  }
  return "";
}

}  // namespace faultline

#include "nodes/rig_packages.h"

#include <cstdlib>
#include <utility>

#include <fmt/format.h>
#include <ros/package.h>

namespace faultline {
namespace {

std::vector<std::string> listed(const char* variable) {
  std::vector<std::string> folders;
  const char* value = std::getenv(variable);
  const std::string text = value != nullptr ? value : "";
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find(':', begin), text.size());
    if (end > begin) folders.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return folders;
}

std::vector<std::string> ros_packages() {
  std::vector<std::string> folders;
  if (listed("ROS_PACKAGE_PATH").empty()) return folders;
  std::vector<std::pair<std::string, std::string>> exports;  // package, rig; one for every rig
  ros::package::getPlugins("faultline", "rig", exports);
  for (const auto& [package, rig] : exports) {
    const std::string folder = ros::package::getPath(package);
    if (!folder.empty() && (folders.empty() || folders.back() != folder)) folders.push_back(folder);
  }
  return folders;
}

}  // namespace

const std::vector<RigPlace>& outside_rigs() {
  static const std::vector<RigPlace> places = [] {
    std::vector<std::string> folders = listed("FAULTLINE_RIG_PATH");
    for (const std::string& folder : ros_packages()) folders.push_back(folder);
    return find_rig_places(folders, listed("CMAKE_PREFIX_PATH"));
  }();
  return places;
}

std::vector<std::string> left_out(const std::string& asked_for) {
  std::vector<std::string> lines;
  for (const RigPlace& place : outside_rigs())
    if (!place.trouble.empty() && (place.rig.empty() || place.rig != asked_for))
      lines.push_back(place.rig.empty() ? place.trouble
                                        : fmt::format("rig '{}' is left out: {}", place.rig, place.trouble));
  return lines;
}

}  // namespace faultline

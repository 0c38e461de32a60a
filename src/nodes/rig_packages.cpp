#include "nodes/rig_packages.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include <fmt/format.h>

#include "faultline/signal/late_library.h"

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

bool is_this_package(const std::string& folder) {
  std::ifstream stream(std::filesystem::path(folder) / "package.xml");
  const std::string text(std::istreambuf_iterator<char>(stream), {});
  return text.find("<name>faultline</name>") != std::string::npos;
}

std::vector<std::string> ros_packages() {
  // A folder of the path that is a package holds no others: where all are this one, rospack, which brings Python, need
  // not be asked.
  const std::vector<std::string> path = listed("ROS_PACKAGE_PATH");
  if (std::all_of(path.begin(), path.end(), is_this_package)) return {};
  using Packages = void(std::vector<std::string>&);
  std::vector<std::string> folders;
  late<Packages>("faultline_rospack", "faultline_ros_packages")(folders);
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

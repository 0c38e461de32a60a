// Of the library faultline_rospack: folders of the ROS packages that depend on faultline and export a rig.
#include <string>
#include <utility>
#include <vector>

#include <ros/package.h>

extern "C" void faultline_ros_packages(std::vector<std::string>& folders) {
  std::vector<std::pair<std::string, std::string>> exports;  // package, rig; one for every rig
  ros::package::getPlugins("faultline", "rig", exports);
  for (const auto& [package, rig] : exports) {
    const std::string folder = ros::package::getPath(package);
    if (!folder.empty() && (folders.empty() || folders.back() != folder)) folders.push_back(folder);
  }
}

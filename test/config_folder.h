// Where the shipped datasheets are for a test: beside its source, else below the working folder.
#pragma once

#include <filesystem>
#include <string>

namespace faultline {

inline std::string config_folder() {
  const std::filesystem::path beside = std::filesystem::path(__FILE__).parent_path() / "../config";
  return std::filesystem::exists(beside) ? beside.lexically_normal().string() : "config";
}

}  // namespace faultline

// Rigs as users bring them, equations and a datasheet only: tanks at 0.25 Hz with a level that is not measured, a valve
// at 10 kHz with a velocity that is not measured, and a chain of more states than a filter takes.
#pragma once

#include <filesystem>
#include <string>

#include "faultline/rig/datasheet.h"

namespace faultline {

inline std::string own_rig_file(const std::string& name) {
  const std::filesystem::path beside = std::filesystem::path(__FILE__).parent_path() / (name + ".yaml");
  return std::filesystem::exists(beside) ? beside.string() : "test/own_rig/" + name + ".yaml";
}

inline Datasheet own_rig(const std::string& name) { return read_datasheet(own_rig_file(name)); }

}  // namespace faultline

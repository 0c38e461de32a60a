// JSON as the program writes it: indented, and bytes of names and remarks that are not UTF-8 shown as the replacement
// character.
#pragma once

#include <string>

#include <nlohmann/json.hpp>

namespace faultline {

inline std::string json_text(const nlohmann::ordered_json& json) {
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace faultline

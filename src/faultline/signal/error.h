// The one exception that bad input raises. Its text is one line: what is wrong, where, and what to do about it.
#pragma once

#include <stdexcept>
#include <string>

namespace faultline {

class InputError : public std::runtime_error {
 public:
  explicit InputError(const std::string& message) : std::runtime_error(message) {}
};

}  // namespace faultline

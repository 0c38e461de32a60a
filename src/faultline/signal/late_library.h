// Parts of the program that are loaded when they are first needed: what they stand on takes longer to load than most of
// what is done without them. Each is a library beside this one, of sources *_late.cpp, with functions of C linkage.
#pragma once

#include <string>

namespace faultline {

// The function `symbol` of the library `name`, which stays loaded. std::runtime_error where it is not there.
void* late_symbol(const std::string& name, const std::string& symbol);

template <class Function>
Function* late(const std::string& name, const std::string& symbol) {
  return reinterpret_cast<Function*>(late_symbol(name, symbol));
}

}  // namespace faultline

// Counts what a piece of code takes from the heap in this thread: operator new is replaced in allocations.cpp.
#pragma once

#include <cstdint>

namespace faultline {

std::uint64_t allocations();

}  // namespace faultline

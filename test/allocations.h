// Counts what a piece of code takes from the heap in its thread. Exactly one file of a program includes
// count_allocations.h.
#pragma once

#include <cstdint>

namespace faultline {

std::uint64_t allocations();

}  // namespace faultline

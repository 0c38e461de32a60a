// Work shared among threads.
#pragma once

#include <cstddef>
#include <functional>

namespace faultline {

// Runs `work(i)` for i in 0..count-1 on `jobs` threads; results do not depend on the order. The first exception ends it all and is
// thrown on.
void parallel(std::size_t count, int jobs, const std::function<void(std::size_t)>& work);

}  // namespace faultline

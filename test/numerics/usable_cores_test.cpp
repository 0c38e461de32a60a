#include "faultline/numerics/usable_cores.h"

#include <thread>

#include <gtest/gtest.h>
#include <sched.h>

namespace faultline {
namespace {

TEST(UsableCores, CountsThoseThatItIsBoundTo) {
  EXPECT_GE(usable_cores(), 1);
  int bound = 0;
  std::thread([&bound] {
    cpu_set_t allowed;
    ASSERT_EQ(sched_getaffinity(0, sizeof(allowed), &allowed), 0);
    int first = 0;
    while (!CPU_ISSET(first, &allowed)) ++first;
    CPU_ZERO(&allowed);
    CPU_SET(first, &allowed);
    ASSERT_EQ(sched_setaffinity(0, sizeof(allowed), &allowed), 0);
    bound = usable_cores();
  }).join();
  EXPECT_EQ(bound, 1);
}

}  // namespace
}  // namespace faultline

// Loops in loops share one number of threads.
#include "faultline/numerics/in_parallel.h"

#include <gtest/gtest.h>

#include <chrono>
#include <condition_variable>
#include <stdexcept>

namespace faultline {
namespace {

TEST(InParallel, EveryPieceIsDoneOnce) {
  for (const int jobs : {0, 1, 2, 5}) {
    std::vector<std::atomic<int>> done(37);
    in_parallel(done.size(), jobs, [&](std::size_t i) { ++done[i]; });
    for (const std::atomic<int>& d : done) EXPECT_EQ(d, 1);
    in_parallel(0, jobs, [&](std::size_t) { ADD_FAILURE(); });
    EXPECT_EQ(threads_beside, 0);
  }
}

TEST(InParallel, LoopsWithinLoopsHaveNoMoreThreadsThanOne) {
  constexpr int kJobs = 3;
  std::atomic<int> now{0}, most{0};
  in_parallel(6, kJobs, [&](std::size_t) {
    in_parallel(6, kJobs, [&](std::size_t) {
      const int at_work = ++now;
      int seen = most;
      while (seen < at_work && !most.compare_exchange_weak(seen, at_work)) {
      }
      std::this_thread::yield();
      --now;
    });
  });
  EXPECT_LE(most, kJobs);
  EXPECT_EQ(threads_beside, 0);
}

// The second piece of the outer loop waits until the first is over, whose thread it then gets for two pieces that wait
// for each other.
TEST(InParallel, AnInnerLoopTakesTheThreadThatHasNothingLeftToDo) {
  std::mutex guard;
  std::condition_variable moved;
  int meeting = 0;
  const auto meet = [&] {
    std::unique_lock<std::mutex> lock(guard);
    ++meeting;
    moved.notify_all();
    return moved.wait_for(lock, std::chrono::seconds(60), [&] { return meeting == 2; });
  };
  in_parallel(2, 2, [&](std::size_t i) {
    if (i == 0) return;
    while (idle_threads(2) < 2) std::this_thread::yield();
    in_parallel(2, 2, [&](std::size_t) { EXPECT_TRUE(meet()); });
  });
  EXPECT_EQ(meeting, 2);
  EXPECT_EQ(threads_beside, 0);
}

TEST(InParallel, TheFirstFailureIsThrownAndTheThreadsAreFreeAgain) {
  EXPECT_THROW(in_parallel(8, 4,
                           [](std::size_t i) {
                             in_parallel(2, 4, [i](std::size_t) {
                               if (i == 3) throw std::runtime_error("three");
                             });
                           }),
               std::runtime_error);
  EXPECT_EQ(threads_beside, 0);
}

}  // namespace
}  // namespace faultline

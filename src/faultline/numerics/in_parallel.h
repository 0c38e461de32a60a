// Runs work(0) ... work(count - 1) on at most `jobs` threads. What comes out must not depend on the order. The first
// exception ends it all and is thrown on.
//
// Loops may stand in loops and all name the same `jobs`: threads beyond the first are counted over the process, so an
// inner loop takes those that the outer one leaves idle, and none where all have work.
#pragma once

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace faultline {

inline std::atomic<int> threads_beside{0};  // that work now for in_parallel(), beyond one

// How many threads a loop would get now.
inline int idle_threads(int jobs) { return std::max(1, jobs - threads_beside.load()); }

template <class Work>
void in_parallel(std::size_t count, int jobs, Work&& work) {
  std::atomic<std::size_t> next{0};
  std::exception_ptr failure;
  std::mutex guard;
  const auto worker = [&] {
    for (std::size_t i = next++; i < count; i = next++) {
      try {
        work(i);
      } catch (...) {
        const std::lock_guard<std::mutex> lock(guard);
        if (!failure) failure = std::current_exception();
        next = count;
      }
    }
    --threads_beside;  // what waits for the others below, or ends, leaves its place to loops within
  };
  std::vector<std::thread> threads;
  int beside = threads_beside.load();
  while (threads.size() + 1 < count && beside + 1 < jobs)
    if (threads_beside.compare_exchange_weak(beside, beside + 1)) {
      threads.emplace_back(worker);
      ++beside;
    }
  worker();
  for (std::thread& thread : threads) thread.join();
  ++threads_beside;
  if (failure) std::rethrow_exception(failure);
}

}  // namespace faultline

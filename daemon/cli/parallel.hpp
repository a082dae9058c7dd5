// Independent work on all cores.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace combforce {

// Calls work(i) for every i below `count`, each thread with its own work = make_work(), made in that thread.
// Which thread takes which i is left to chance: work(i) must depend on i only. Rethrows the first exception.
template <typename MakeWork>
void parallel_for(std::size_t count, const MakeWork& make_work) {
  std::atomic<std::size_t> next{0};
  std::exception_ptr failure;
  std::mutex failure_mutex;
  const auto run = [&] {
    try {
      auto work = make_work();
      for (std::size_t i = next++; i < count; i = next++) work(i);
    } catch (...) {
      next = count;
      const std::lock_guard lock(failure_mutex);
      if (!failure) failure = std::current_exception();
    }
  };
  {
    std::vector<std::jthread> threads(std::max(1U, std::thread::hardware_concurrency()));
    for (std::jthread& thread : threads) thread = std::jthread(run);
  }
  if (failure) std::rethrow_exception(failure);
}

}  // namespace combforce

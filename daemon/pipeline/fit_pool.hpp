// N fit workers, each behind its own bounded queue of slot indices.
//
// Thread rule: offer() by the extraction thread; construction and destruction by the control thread.
#pragma once

#include <atomic>
#include <boost/lockfree/spsc_queue.hpp>
#include <cstdint>
#include <memory>
#include <thread>
#include <vector>

#include "daemon/pipeline/output_slots.hpp"

namespace combforce {

class FitPool {
 public:
  // Pixels a worker may have waiting: deep enough that it never runs dry between two pixels, shallow enough
  // that what cannot be fitted in time is known (not_fitted) within a few fits.
  static constexpr std::size_t queue_depth = 8;

  FitPool(unsigned workers, OutputSlots& slots);
  ~FitPool();  // finishes what was offered, then joins
  FitPool(const FitPool&) = delete;
  FitPool& operator=(const FitPool&) = delete;

  // Gives the slot to the worker with the shortest queue and wakes it. False: all queues are full.
  bool offer(std::uint32_t slot);
  // Waits until a queue may have room again.
  void wait_room();

  unsigned workers() const { return static_cast<unsigned>(workers_.size()); }

 private:
  struct Worker {
    boost::lockfree::spsc_queue<std::uint32_t, boost::lockfree::capacity<queue_depth>> queue;
    std::atomic<std::uint32_t> offered{
        0};  // bumped with every slot and at the end: what the worker sleeps on
    std::thread thread;
  };
  void work(unsigned index);

  OutputSlots& slots_;
  std::vector<std::unique_ptr<Worker>> workers_;
  std::atomic<bool> ending_{false};
  std::atomic<std::uint32_t> taken_{0};  // bumped with every slot a worker takes
  std::uint32_t taken_seen_ = 0;         // before the last offer()
};

}  // namespace combforce

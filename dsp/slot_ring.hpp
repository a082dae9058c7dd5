// Single-producer single-consumer ring over preallocated slots.
//
// Two lock-free queues of slot indices (free, filled) over slots that the constructor makes: pushing and
// popping moves indices, never slots, and never allocates, locks or waits.
//
// Thread rule: producer calls (acquire, publish) from one thread, consumer calls (front, release, filled)
// from one thread.
#pragma once

#include <boost/lockfree/spsc_queue.hpp>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace combforce {

template <typename T>
class SlotRing {
 public:
  // `slots` >= 1 copies of `prototype`.
  SlotRing(std::size_t slots, const T& prototype) : slots_(slots, prototype), free_(slots), filled_(slots) {
    for (std::size_t i = 0; i < slots; ++i) free_.push(static_cast<std::uint32_t>(i));
  }

  // Producer: the next empty slot to fill, or null when the ring is full. Repeated calls without publish()
  // return the same slot.
  T* acquire() {
    if (!held_ && !free_.pop(producing_)) return nullptr;
    held_ = true;
    return &slots_[producing_];
  }

  // Producer: hands the acquired slot to the consumer. acquire() must have returned it.
  void publish() {
    filled_.push(producing_);
    held_ = false;
  }

  // Consumer: the oldest filled slot, or null when there is none. It stays valid until release().
  T* front() { return filled_.read_available() > 0 ? &slots_[filled_.front()] : nullptr; }

  // Consumer: gives the front slot back. front() must have returned it.
  void release() {
    std::uint32_t index = 0;
    filled_.pop(index);
    free_.push(index);
  }

  std::size_t capacity() const { return slots_.size(); }

  // Consumer: how many slots wait; the producer may add to them meanwhile.
  std::size_t filled() const { return filled_.read_available(); }

 private:
  std::vector<T> slots_;
  boost::lockfree::spsc_queue<std::uint32_t> free_;
  boost::lockfree::spsc_queue<std::uint32_t> filled_;
  std::uint32_t producing_ = 0;
  bool held_ = false;
};

}  // namespace combforce

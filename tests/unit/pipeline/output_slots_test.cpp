#include "daemon/pipeline/output_slots.hpp"

#include <gtest/gtest.h>

#include <deque>
#include <mutex>
#include <random>
#include <thread>

namespace combforce {
namespace {

TEST(OutputSlots, RetireInOrderOfCommitWhateverTheOrderOfCompletion) {
  OutputSlots slots(4, 1, 1);
  std::vector<std::uint32_t> indices;
  for (std::uint64_t i = 0; i < 4; ++i) {
    OutputSlot* slot = slots.acquire();
    ASSERT_NE(slot, nullptr);
    slot->first_sample = i;
    indices.push_back(slots.commit_pending());
  }
  EXPECT_EQ(slots.acquire(), nullptr) << "all four are taken";
  slots.complete(indices[2]);
  slots.complete(indices[1]);
  EXPECT_EQ(slots.front(), nullptr) << "the oldest is not complete";
  slots.complete(indices[0]);
  for (std::uint64_t i = 0; i < 3; ++i) {
    ASSERT_NE(slots.front(), nullptr);
    EXPECT_EQ(slots.front()->first_sample, i);
    slots.retire();
  }
  EXPECT_EQ(slots.front(), nullptr);
  EXPECT_NE(slots.acquire(), nullptr);
}

// Three workers complete what they are given in any order; the consumer must see every number once, in order.
TEST(OutputSlots, KeepOrderAcrossThreads) {
  constexpr std::uint64_t total = 20000;
  OutputSlots slots(16, 1, 1);
  std::mutex mutex;
  std::deque<std::uint32_t> work;
  bool over = false;
  std::vector<std::thread> workers;
  for (unsigned w = 0; w < 3; ++w)
    workers.emplace_back([&, w] {
      std::mt19937 random(w);
      for (;;) {
        std::uint32_t index = 0;
        {
          const std::scoped_lock lock(mutex);
          if (work.empty() && over) return;
          if (work.empty()) continue;
          const std::size_t pick = random() % work.size();
          index = work[pick];
          work.erase(work.begin() + static_cast<std::ptrdiff_t>(pick));
        }
        slots.at(index).count = slots.at(index).first_sample * 3;
        slots.complete(index);
      }
    });
  std::thread consumer([&] {
    for (std::uint64_t i = 0; i < total; ++i) {
      slots.wait_front();
      EXPECT_EQ(slots.front()->first_sample, i);
      EXPECT_EQ(slots.front()->count, 3 * i);
      slots.retire();
    }
  });
  for (std::uint64_t i = 0; i < total; ++i) {
    OutputSlot* slot = slots.acquire();
    if (slot == nullptr) {
      slots.wait_room();
      slot = slots.acquire();
    }
    slot->first_sample = i;
    if (i % 5 == 0) {
      slot->count = 3 * i;
      slots.commit_complete();
      continue;
    }
    const std::uint32_t index = slots.commit_pending();
    const std::scoped_lock lock(mutex);
    work.push_back(index);
  }
  consumer.join();
  {
    const std::scoped_lock lock(mutex);
    over = true;
  }
  for (std::thread& worker : workers) worker.join();
}

}  // namespace
}  // namespace combforce

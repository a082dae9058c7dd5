#include "dsp/slot_ring.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <deque>
#include <random>
#include <set>
#include <thread>
#include <vector>

#include "tests/support/failing_allocator.hpp"

namespace combforce {
namespace {

struct Item {
  std::uint64_t number = 0;
  std::vector<std::uint64_t> payload;
};

Item item_of(std::size_t length) {
  return {0, std::vector<std::uint64_t>(length)};
}

TEST(SlotRing, BehavesLikeABoundedQueue) {
  for (const std::size_t slots : {1U, 2U, 3U, 7U, 64U}) {
    SlotRing<Item> ring(slots, item_of(1));
    ASSERT_EQ(ring.capacity(), slots);
    std::deque<std::uint64_t> model;
    std::mt19937_64 random(slots);
    std::uint64_t next = 0;
    for (int step = 0; step < 20000; ++step) {
      // Long stretches of mostly pushes and mostly pops reach both ends.
      const bool filling = step / 200 % 2 == 0;
      const bool push = random() % 4 != (filling ? 0U : 1U) && (filling || random() % 2 == 0);
      if (push) {
        Item* const slot = ring.acquire();
        ASSERT_EQ(slot == nullptr, model.size() == slots);
        if (slot == nullptr) continue;
        ASSERT_EQ(ring.acquire(), slot) << "acquire() without publish() keeps its slot";
        slot->number = next;
        slot->payload[0] = ~next;
        ASSERT_EQ(ring.filled(), model.size()) << "not yet published";
        ring.publish();
        model.push_back(next++);
      } else {
        Item* const front = ring.front();
        ASSERT_EQ(front == nullptr, model.empty());
        if (front == nullptr) continue;
        ASSERT_EQ(front->number, model.front());
        ASSERT_EQ(front->payload[0], ~model.front());
        ASSERT_EQ(ring.front(), front) << "front() does not consume";
        ring.release();
        model.pop_front();
      }
      ASSERT_EQ(ring.filled(), model.size());
    }
    EXPECT_GT(next, slots * 100);
  }
}

TEST(SlotRing, AcquiredSlotAndFrontAreNeverTheSame) {
  SlotRing<Item> ring(2, item_of(1));
  std::set<Item*> seen;
  for (int i = 0; i < 10; ++i) {
    Item* const filling = ring.acquire();
    ASSERT_NE(filling, nullptr);
    ASSERT_NE(filling, ring.front());
    seen.insert(filling);
    ring.publish();
    if (ring.filled() == 2) ring.release();
  }
  EXPECT_EQ(seen.size(), 2U);
}

TEST(SlotRing, DoesNotAllocate) {
  COMBFORCE_SKIP_UNLESS_ALLOCATIONS_COUNT();
  SlotRing<Item> ring(4, item_of(100));
  const test::ForbidAllocation guard;
  for (std::uint64_t i = 0; i < 1000; ++i) {
    while (Item* const slot = ring.acquire()) {
      slot->payload[i % 100] = i;
      ring.publish();
    }
    while (ring.front() != nullptr) ring.release();
  }
  EXPECT_EQ(guard.calls(), 0U);
}

// Every number arrives once, in order, with the whole payload its producer wrote: a reordered, repeated, lost
// or half-written slot fails. Both sides yield at random, so that the ring runs full and empty.
TEST(SlotRing, TwoThreadsSeeEveryValueInOrder) {
  constexpr std::uint64_t count = 100000;
  constexpr std::size_t length = 5;
  for (const std::size_t slots : {1U, 3U, 16U}) {
    SlotRing<Item> ring(slots, item_of(length));
    std::thread producer([&ring] {
      std::mt19937 random(1);
      for (std::uint64_t number = 0; number < count;) {
        Item* const slot = ring.acquire();
        if (slot == nullptr || random() % 64 == 0) std::this_thread::yield();
        if (slot == nullptr) continue;
        slot->number = number;
        for (std::size_t i = 0; i < length; ++i) slot->payload[i] = number * length + i;
        ring.publish();
        ++number;
      }
    });
    std::mt19937 random(2);
    std::uint64_t wrong = 0;
    std::uint64_t overfull = 0;
    for (std::uint64_t expected = 0; expected < count;) {
      overfull += static_cast<std::uint64_t>(ring.filled() > slots);
      const Item* const front = ring.front();
      if (front == nullptr || random() % 64 == 0) std::this_thread::yield();
      if (front == nullptr) continue;
      bool good = front->number == expected;
      for (std::size_t i = 0; i < length; ++i) good = good && front->payload[i] == expected * length + i;
      wrong += static_cast<std::uint64_t>(!good);
      ring.release();
      ++expected;
    }
    producer.join();
    EXPECT_EQ(wrong, 0U) << slots;
    EXPECT_EQ(overfull, 0U) << slots;
    EXPECT_EQ(ring.front(), nullptr) << "nothing beyond what was published";
  }
}

}  // namespace
}  // namespace combforce

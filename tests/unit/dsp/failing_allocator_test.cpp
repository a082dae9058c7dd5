#include "tests/support/failing_allocator.hpp"

#include <fftw3.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <new>
#include <thread>

namespace combforce::test {
namespace {

// Heap by hand is what is tested.
// NOLINTBEGIN(cppcoreguidelines-no-malloc, bugprone-suspicious-realloc-usage)

// The compiler may elide an allocation whose result goes nowhere.
void* volatile sink = nullptr;

template <typename Action>
std::size_t calls_of(const Action& action) {
  const ForbidAllocation guard;
  action();
  return guard.calls();
}

TEST(FailingAllocator, CountsNothingWhereNothingIsAllocated) {
  EXPECT_EQ(calls_of([] {
              int local[16] = {};
              sink = local;
              sink = nullptr;
              std::free(sink);
            }),
            0U);
}

TEST(FailingAllocator, CountsEveryWayToTheHeap) {
  COMBFORCE_SKIP_UNLESS_ALLOCATIONS_COUNT();
  const auto malloc_free = [] {
    sink = std::malloc(8);
    std::free(sink);
  };
  const auto calloc_realloc_free = [] {
    sink = std::calloc(2, 8);
    sink = std::realloc(sink, 100);
    std::free(sink);
  };
  const auto aligned = [] {
    sink = std::aligned_alloc(64, 128);
    std::free(sink);
  };
  const auto posix = [] {
    void* memory = nullptr;
    if (posix_memalign(&memory, 64, 128) == 0) sink = memory;
    std::free(sink);
  };
  struct alignas(128) Wide {
    char bytes[128];
  };
  const auto operators = [] {
    sink = ::operator new(8);
    ::operator delete(sink);
    auto wide = std::make_unique<Wide>();
    sink = wide.get();
  };
  const auto eigen = [] {
    Eigen::VectorXd vector(100);
    sink = vector.data();
  };
  const auto fftw = [] {
    sink = fftw_malloc(100);
    fftw_free(sink);
  };
  EXPECT_EQ(calls_of(malloc_free), 2U);
  EXPECT_EQ(calls_of(calloc_realloc_free), 3U);
  EXPECT_EQ(calls_of(aligned), 2U);
  EXPECT_EQ(calls_of(posix), 2U);
  EXPECT_EQ(calls_of(operators), 4U);
  EXPECT_EQ(calls_of(eigen), 2U);
  EXPECT_EQ(calls_of(fftw), 2U);
}

TEST(FailingAllocator, MemoryIsUsableAndAligned) {
  COMBFORCE_SKIP_UNLESS_ALLOCATIONS_COUNT();  // a sanitizer's own allocator aborts at the last line
  void* memory = nullptr;
  ASSERT_EQ(posix_memalign(&memory, 4096, 100), 0);
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(memory) % 4096, 0U);
  std::free(memory);
  EXPECT_NE(posix_memalign(&memory, 24, 100), 0) << "not a power of two";
}

TEST(FailingAllocator, GuardsNestAndEnd) {
  COMBFORCE_SKIP_UNLESS_ALLOCATIONS_COUNT();
  const ForbidAllocation outer;
  sink = std::malloc(8);
  {
    const ForbidAllocation inner;
    std::free(sink);
    EXPECT_EQ(inner.calls(), 1U);
  }
  EXPECT_EQ(outer.calls(), 2U);
}

TEST(FailingAllocator, OtherThreadsMayAllocate) {
  COMBFORCE_SKIP_UNLESS_ALLOCATIONS_COUNT();
  std::atomic<bool> guarded{false};
  std::atomic<bool> allocated{false};
  std::thread other([&] {
    while (!guarded) std::this_thread::yield();
    sink = std::malloc(8);
    std::free(sink);
    allocated = true;
  });
  std::size_t calls = 1;
  {
    const ForbidAllocation guard;
    guarded = true;
    while (!allocated) std::this_thread::yield();
    calls = guard.calls();
  }
  other.join();
  EXPECT_EQ(calls, 0U);
}

// NOLINTEND(cppcoreguidelines-no-malloc, bugprone-suspicious-realloc-usage)

}  // namespace
}  // namespace combforce::test

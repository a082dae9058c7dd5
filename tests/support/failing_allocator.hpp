// Proves that a stretch of code does not touch the heap: a program that links combforce_failing_allocator has
// malloc, calloc, realloc, the aligned ones and free replaced by counting ones (operator new, Eigen and FFTW
// end there). Not under sanitizers, which replace them themselves.
#pragma once

#include <cstddef>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define COMBFORCE_COUNTS_ALLOCATIONS 0
#else
#define COMBFORCE_COUNTS_ALLOCATIONS 1
#endif

namespace combforce::test {

// While a guard lives, calls of the allocator by its own thread are counted; freeing a null pointer is no
// call. Guards nest: the outer one counts what the inner one does. They must not outlive their scope's order.
//     { const ForbidAllocation guard; extractor.add(samples, frames); calls = guard.calls(); }
//     EXPECT_EQ(calls, 0);
// To find a culprit, break in a debugger at combforce::test::forbidden_call.
class ForbidAllocation {
 public:
  ForbidAllocation();
  ~ForbidAllocation();
  ForbidAllocation(const ForbidAllocation&) = delete;
  ForbidAllocation& operator=(const ForbidAllocation&) = delete;

  std::size_t calls() const;

 private:
  std::size_t calls_before_;
};

}  // namespace combforce::test

// First line of a test that relies on the count.
#define COMBFORCE_SKIP_UNLESS_ALLOCATIONS_COUNT() \
  if (!COMBFORCE_COUNTS_ALLOCATIONS) GTEST_SKIP() << "a sanitizer owns malloc"

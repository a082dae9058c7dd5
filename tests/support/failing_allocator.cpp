#include "tests/support/failing_allocator.hpp"

#include <cerrno>

namespace combforce::test {

namespace {

// Plain thread-locals of the program itself: reading them never allocates.
thread_local int guards = 0;
thread_local std::size_t forbidden_calls = 0;

}  // namespace

[[gnu::noinline]] void forbidden_call() {
  ++forbidden_calls;
}

namespace {

[[maybe_unused]] void note_call() {
  if (guards > 0) forbidden_call();
}

}  // namespace

ForbidAllocation::ForbidAllocation() : calls_before_(forbidden_calls) {
  ++guards;
}
ForbidAllocation::~ForbidAllocation() {
  --guards;
}
std::size_t ForbidAllocation::calls() const {
  return forbidden_calls - calls_before_;
}

}  // namespace combforce::test

#if COMBFORCE_COUNTS_ALLOCATIONS

using combforce::test::note_call;

extern "C" {

// glibc's own, under the names it keeps for interposers.
// NOLINTBEGIN(bugprone-reserved-identifier)
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* memory, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
void __libc_free(void* memory);
// NOLINTEND(bugprone-reserved-identifier)

void* malloc(std::size_t size) {
  note_call();
  return __libc_malloc(size);
}

void* calloc(std::size_t count, std::size_t size) {
  note_call();
  return __libc_calloc(count, size);
}

void* realloc(void* memory, std::size_t size) {
  note_call();
  return __libc_realloc(memory, size);
}

void* memalign(std::size_t alignment, std::size_t size) {
  note_call();
  return __libc_memalign(alignment, size);
}

void* aligned_alloc(std::size_t alignment, std::size_t size) {
  note_call();
  return __libc_memalign(alignment, size);
}

int posix_memalign(void** memory, std::size_t alignment, std::size_t size) {
  note_call();
  if (alignment % sizeof(void*) != 0 || (alignment & (alignment - 1)) != 0 || alignment == 0) return EINVAL;
  void* const block = __libc_memalign(alignment, size);
  if (block == nullptr) return ENOMEM;
  *memory = block;
  return 0;
}

void free(void* memory) {
  if (memory != nullptr) note_call();
  __libc_free(memory);
}

}  // extern "C"

#endif

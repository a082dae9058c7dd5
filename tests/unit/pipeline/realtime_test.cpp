// The extraction thread does not touch the heap once it runs: blocks in, pixels out.
#include <gtest/gtest.h>

#include <thread>

#include "daemon/pipeline/extraction.hpp"
#include "tests/support/failing_allocator.hpp"
#include "tests/support/synthetic_stream.hpp"

namespace combforce {
namespace {

TEST(Extraction, DoesNotAllocate) {
  COMBFORCE_SKIP_UNLESS_ALLOCATIONS_COUNT();
  const StreamInfo info = test::one_channel(1e6, 512);
  Description description;
  description.comb = Comb{200, {{7, true}, {31, true}}};
  ScanLayout layout;
  layout.columns = 10;
  layout.pixel_samples = 500;
  layout.settle_samples = 100;
  layout.windows = 2;
  description.scan = layout;
  OutputSlots slots(64, 2, 1);
  FitPool pool(1, slots);
  auto stage = std::make_unique<AnalysisStage>(info, make_analysis(info, description), 1U);
  Extraction extraction(info, std::move(stage), {}, slots, pool);
  std::size_t pixels = 0, calls = 0;
  std::thread output([&] {
    for (bool more = true; more; slots.retire()) {
      slots.wait_front();
      pixels += slots.front()->kind == OutputSlot::Kind::pixel ? 1U : 0U;
      more = slots.front()->kind != OutputSlot::Kind::end;
    }
  });
  SampleBlock block(512 * sizeof(std::int16_t));
  {
    const test::ForbidAllocation guard;
    for (std::uint64_t first = 0; first < 60000; first += 512) {
      block.header.first_sample = first + (first > 30000 ? 700 : 0);  // one gap
      block.header.frames = 512;
      block.header.mark_count = first % 6144 == 0 ? 1 : 0;
      block.header.marks[0].sample = block.header.first_sample;
      block.header.marks[0].line = {0, 0, Direction::trace, block.header.first_sample, 5000};
      extraction.process(block);
    }
    extraction.finish();
    calls = guard.calls();
  }
  output.join();
  EXPECT_EQ(calls, 0U);
  EXPECT_EQ(pixels, 100U);
}

}  // namespace
}  // namespace combforce

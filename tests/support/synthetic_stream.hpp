// A stream made up sample by sample, for tests of what happens behind a digitizer.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "daemon/pipeline/pipeline.hpp"
#include "drivers/block_sink.hpp"
#include "drivers/digitizer.hpp"
#include "proto/pixel_message.hpp"

namespace combforce::test {

// Half-open range of stream samples.
struct Range {
  std::uint64_t first = 0, end = 0;
};

struct SyntheticStream {
  std::uint64_t first_sample = 0;
  std::uint64_t samples = 0;
  std::function<std::int16_t(std::uint64_t)> value;  // of stream sample n, channel 0
  std::vector<StreamMark> marks;                     // ordered by sample
  std::vector<Range> lost;                           // ordered, disjoint: never delivered, known length
  std::vector<std::uint64_t> new_epochs;             // ordered: the clock breaks before this sample

  // Pushes everything in blocks of sizes drawn by `block_frames()`, then closes the sink.
  void push_into(BlockSink& sink, const std::function<std::uint32_t()>& block_frames) const;
};

// One channel of int16, a source that waits.
StreamInfo one_channel(double sample_rate_hz, std::uint32_t block_frames);

// Everything a pipeline puts out, in order.
struct Recorded {
  std::vector<Pixel> pixels;
  std::vector<std::vector<std::complex<double>>> tip_nm;
  std::vector<FitResult> fits;
  std::string lines;               // as a subscriber receives them
  std::vector<std::string> order;  // "pixel", "line", "frame", event kinds, "change"
  std::vector<Event> events;
  std::vector<LineDone> line_ends;
  std::vector<FrameDone> frame_ends;

  PipelineOutputs outputs();
};

// Runs a pipeline over the stream to its end.
Recorded run(const SyntheticStream& stream, const StreamInfo& info, const Description& description,
             const std::function<std::uint32_t()>& block_frames, unsigned threads = 1,
             std::vector<ScheduledChange> changes = {});

}  // namespace combforce::test

// Runs a digitizer to its end and keeps what it delivered.
#pragma once

#include <algorithm>
#include <vector>

#include "drivers/block_sink.hpp"
#include "drivers/digitizer.hpp"

namespace combforce::test {

inline std::size_t block_bytes(const StreamInfo& info) {
  return std::size_t{info.block_frames} * info.channels.size() * sample_bytes(info.format);
}

// Takes blocks until the stream closes.
inline std::vector<SampleBlock> take_to_end(BlockSink& sink) {
  std::vector<SampleBlock> blocks;
  for (bool last = false; !last;) {
    sink.wait_extraction();
    last = sink.closed() || sink.cancelled();
    while (const SampleBlock* block = sink.extraction().front()) {
      SampleBlock& copy = blocks.emplace_back(block->header.bytes());
      copy.header = block->header;
      std::copy_n(block->storage.begin(), copy.storage.size(), copy.storage.begin());
      sink.extraction().release();
      sink.released();
    }
  }
  return blocks;
}

inline std::vector<SampleBlock> run_to_end(Digitizer& digitizer, std::size_t slots = 8) {
  BlockSink sink(slots, block_bytes(digitizer.info()), digitizer.info().when_full);
  digitizer.start(sink);
  std::vector<SampleBlock> blocks = take_to_end(sink);
  digitizer.stop();
  return blocks;
}

// The codes of all blocks, interleaved as delivered.
inline std::vector<double> codes_of(const std::vector<SampleBlock>& blocks) {
  std::vector<double> codes;
  for (const SampleBlock& block : blocks) {
    if (block.header.format == SampleFormat::i16)
      codes.insert(codes.end(), block.i16().begin(), block.i16().end());
    else
      codes.insert(codes.end(), block.f32().begin(), block.f32().end());
  }
  return codes;
}

}  // namespace combforce::test

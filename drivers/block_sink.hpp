// Where a digitizer puts its blocks: the seams digitizer -> extraction and digitizer -> recorder, each a ring with
// its own accounting of loss.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "dsp/sample_block.hpp"
#include "dsp/slot_ring.hpp"

namespace combforce {

using SampleRing = SlotRing<SampleBlock>;

// What push() does when a ring is full.
enum class WhenFull : std::uint8_t {
  drop,  // live source: the new block is lost, counted, and reported as lost_before of the next one
  wait   // a source that can wait (replay, free-running simulation): until there is room or cancel()
};

// Thread rule: push() from the digitizer's thread only; start_recording(), stop_recording(), cancel() and the
// counters from any. With WhenFull::drop, push() does not allocate, lock or wait; waking the consumers is
// one futex call each (std::atomic notify).
class BlockSink {
 public:
  // `slots` blocks of `block_bytes` in each ring; the rings are allocated here.
  BlockSink(std::size_t slots, std::size_t block_bytes, WhenFull when_full);

  // Copies the block into the extraction ring and, while recording, into the recorder ring. `header.lost_before`
  // is what the source itself lost; drops of the sink are added to it, separately for each ring, and marks of a
  // dropped block are carried to the next. False: the extraction ring had no room, or cancel() was called.
  bool push(const BlockHeader& header, const void* samples);

  // Consumers. A wait ends with a filled ring, with the end of the stream (close()) or with cancel().
  SampleRing& extraction() { return extraction_; }
  SampleRing& recorder() { return recorder_; }
  void wait_extraction();
  void wait_recorder();
  void released();  // a consumer gave a slot back: wakes a waiting source

  // From the next block on, or up to the one in progress.
  void start_recording() { recording_.store(true); }
  void stop_recording() { recording_.store(false); }
  bool recording() const { return recording_.load(); }

  // The source has pushed its last block.
  void close();
  bool closed() const { return closed_.load(); }
  // Ends every wait; push() drops from now on.
  void cancel();
  bool cancelled() const { return cancelled_.load(); }

  // Frames dropped at each seam since construction.
  std::uint64_t dropped_extraction() const { return dropped_extraction_.load(); }
  std::uint64_t dropped_recorder() const { return dropped_recorder_.load(); }
  std::uint64_t next_sample() const { return next_sample_.load(); }  // one past the last frame pushed or dropped

 private:
  struct Seam {
    std::uint64_t lost = 0;  // frames to report with the next block
    std::array<StreamMark, BlockHeader::max_marks> marks{};
    std::uint32_t mark_count = 0;
  };
  bool push_to(SampleRing& ring, Seam& seam, const BlockHeader& header, const void* samples,
               std::atomic<std::uint32_t>& filled, std::atomic<std::uint64_t>& dropped);

  WhenFull when_full_;
  SampleRing extraction_, recorder_;
  Seam extraction_seam_, recorder_seam_;
  std::atomic<std::uint32_t> extraction_filled_{0}, recorder_filled_{0}, room_{0};  // bumped, then notified
  std::atomic<bool> recording_{false}, closed_{false}, cancelled_{false};
  std::atomic<std::uint64_t> dropped_extraction_{0}, dropped_recorder_{0}, next_sample_{0};
};

}  // namespace combforce

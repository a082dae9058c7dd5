// Where a digitizer puts its blocks: the seams digitizer -> extraction and digitizer -> recorder, each a ring
// with its own accounting of loss.
//
// A consumer's loop; the last block is published before the stream closes, hence the order of the questions:
//
//     for (bool last = false; !last;) {
//       sink.wait_extraction();
//       last = sink.closed() || sink.cancelled();
//       while (SampleBlock* block = sink.extraction().front()) {
//         use(*block);
//         sink.extraction().release();
//         sink.released();
//       }
//     }
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "dsp/sample_block.hpp"
#include "dsp/slot_ring.hpp"

namespace combforce {

using SampleRing = SlotRing<SampleBlock>;

// What push() does when a ring is full.
enum class WhenFull : std::uint8_t {
  drop,  // live source: the new block is lost, counted, and reported as lost_before of the next one
  wait   // a source that can wait (replay, free-running simulation): until room, stop_waiting() or cancel()
};

// What a consumer sees at its ring, whatever the other ring suffers:
// - `lost_before` is what the source lost plus what the sink dropped since the block delivered last in the
//   same epoch. A new epoch starts it afresh, since across epochs no count is meaningful; dropped_…() count
//   on.
// - Marks of a dropped block travel with the next delivered block. Their `sample` then lies before that
//   block's first_sample, within its lost_before or in an earlier epoch. What exceeds max_marks follows with
//   the blocks after it, in order. Marks beyond `carried_marks` waiting ones, and those that still wait at
//   close(), are lost: lost_marks_…().
// - The recorder ring gets blocks only while recording; the first one of a recording has lost_before = 0 and
//   no marks but its own.
//
// Thread rule: push() and close() from the digitizer's thread only; each ring's wait, front and release from
// its one consumer thread; the rest from any. With WhenFull::drop, push() does not allocate, lock or wait;
// waking the consumers is at most one futex call each (std::atomic notify).
class BlockSink {
 public:
  static constexpr std::size_t carried_marks = 256;

  // `slots` >= 1 blocks of `block_bytes` in each ring; the rings are allocated here.
  BlockSink(std::size_t slots, std::size_t block_bytes, WhenFull when_full);

  // Copies the block into the extraction ring and, while recording, into the recorder ring.
  // `header.lost_before` is what the source itself lost. A block of more than block_bytes is dropped like one
  // for which there is no room. False: the extraction ring dropped it.
  bool push(const BlockHeader& header, const void* samples);

  // Consumers. A wait ends with a filled ring, with the end of the stream (close()) or with cancel(); the
  // recorder's also while not recording.
  SampleRing& extraction() { return extraction_.ring; }
  SampleRing& recorder() { return recorder_.ring; }
  void wait_extraction();
  void wait_recorder();
  void released();  // a consumer gave a slot back: wakes a waiting source

  // From the next block on, or up to the one in progress: a block may still arrive shortly after
  // stop_recording().
  void start_recording();
  void stop_recording();
  bool recording() const { return recording_.load(); }

  // The source has pushed its last block.
  void close();
  bool closed() const { return closed_.load(); }
  // For a digitizer's stop(): ends a push() that waits; from now on push() drops when full. Consumers go on.
  // Of a source that can wait, a block that the extraction ring has no room for then is not recorded either:
  // the stream ends before it.
  void stop_waiting();
  // Ends every wait; push() drops from now on.
  void cancel();
  bool cancelled() const { return cancelled_.load(); }

  // Frames dropped, and marks that will never be delivered, at each seam since construction.
  std::uint64_t dropped_extraction() const { return extraction_.dropped.load(); }
  std::uint64_t dropped_recorder() const { return recorder_.dropped.load(); }
  std::uint64_t lost_marks_extraction() const { return extraction_.lost_marks.load(); }
  std::uint64_t lost_marks_recorder() const { return recorder_.lost_marks.load(); }
  std::uint64_t next_sample() const {
    return next_sample_.load();
  }  // one past the last frame pushed or dropped

 private:
  struct Seam {
    SampleRing ring;
    // Of the source's thread: frames to report, and marks to deliver, with the next block.
    std::uint32_t epoch = 0;
    std::uint64_t lost = 0;
    std::vector<StreamMark> marks;
    // Read by others.
    std::atomic<std::uint32_t> filled{0};  // bumped, then notified
    std::atomic<std::uint64_t> dropped{0}, lost_marks{0};

    Seam(std::size_t slots, std::size_t block_bytes);
  };
  bool push_to(Seam& seam, const BlockHeader& header, const void* samples);
  SampleBlock* acquire(Seam& seam, std::size_t bytes);
  bool may_wait_for(const Seam& seam) const;

  WhenFull when_full_;
  Seam extraction_, recorder_;
  std::atomic<std::uint32_t> room_{0};  // bumped, then notified
  std::atomic<bool> recording_{false}, recording_restarted_{false};
  std::atomic<bool> closed_{false}, waiting_ended_{false}, cancelled_{false};
  std::atomic<std::uint64_t> next_sample_{0};
};

}  // namespace combforce

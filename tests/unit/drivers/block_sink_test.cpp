#include "drivers/block_sink.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>
#include <vector>

namespace combforce {
namespace {

constexpr std::uint32_t frames = 8;
constexpr std::size_t block_bytes = frames * sizeof(std::int16_t);

StreamMark line_at(std::uint64_t sample) {
  StreamMark mark;
  mark.sample = sample;
  mark.line.first_sample = sample;
  return mark;
}

// A source whose sample n carries the code n mod 2^15.
class Source {
 public:
  explicit Source(BlockSink& sink) : sink_(&sink) {}

  bool push(const std::vector<StreamMark>& marks = {}, std::uint64_t lost_before = 0,
            std::uint32_t epoch = 0) {
    BlockHeader header;
    header.epoch = epoch;
    next_ += lost_before;
    header.first_sample = next_;
    header.frames = frames;
    header.lost_before = lost_before;
    for (const StreamMark& mark : marks) header.marks.at(header.mark_count++) = mark;
    std::vector<std::int16_t> codes;
    for (std::uint32_t i = 0; i < frames; ++i)
      codes.push_back(static_cast<std::int16_t>((next_ + i) & 0x7fff));
    next_ += frames;
    return sink_->push(header, codes.data());
  }
  std::uint64_t next() const { return next_; }

 private:
  BlockSink* sink_;
  std::uint64_t next_ = 0;
};

std::vector<SampleBlock> take_all(SampleRing& ring, BlockSink& sink) {
  std::vector<SampleBlock> blocks;
  while (const SampleBlock* block = ring.front()) {
    blocks.push_back(*block);
    ring.release();
    sink.released();
  }
  return blocks;
}

TEST(BlockSink, DeliversHeaderAndSamples) {
  BlockSink sink(4, block_bytes, WhenFull::drop);
  Source source(sink);
  EXPECT_TRUE(source.push({line_at(3)}, 5));
  EXPECT_EQ(sink.next_sample(), 13u);
  const auto blocks = take_all(sink.extraction(), sink);
  ASSERT_EQ(blocks.size(), 1u);
  EXPECT_EQ(blocks[0].header.first_sample, 5u);
  EXPECT_EQ(blocks[0].header.lost_before, 5u);
  ASSERT_EQ(blocks[0].header.mark_count, 1u);
  EXPECT_EQ(blocks[0].header.marks[0].sample, 3u);
  EXPECT_EQ(blocks[0].i16()[7], 12);
}

TEST(BlockSink, DroppedBlocksAreTheNextOnesLostBefore) {
  BlockSink sink(1, block_bytes, WhenFull::drop);
  Source source(sink);
  EXPECT_TRUE(source.push());
  EXPECT_FALSE(source.push());
  EXPECT_FALSE(source.push({}, 3));
  EXPECT_EQ(sink.dropped_extraction(), 2u * frames);
  take_all(sink.extraction(), sink);
  EXPECT_TRUE(source.push({}, 2));
  const auto blocks = take_all(sink.extraction(), sink);
  ASSERT_EQ(blocks.size(), 1u);
  EXPECT_EQ(blocks[0].header.lost_before, 2u * frames + 3 + 2);
  EXPECT_EQ(blocks[0].header.first_sample, frames + blocks[0].header.lost_before);
}

TEST(BlockSink, NewEpochForgetsTheLossBeforeIt) {
  BlockSink sink(1, block_bytes, WhenFull::drop);
  Source source(sink);
  source.push();
  source.push();          // dropped in epoch 0
  source.push({}, 0, 1);  // dropped, the first block of epoch 1
  take_all(sink.extraction(), sink);
  source.push({}, 0, 1);
  const auto blocks = take_all(sink.extraction(), sink);
  ASSERT_EQ(blocks.size(), 1u);
  EXPECT_EQ(blocks[0].header.epoch, 1u);
  EXPECT_EQ(blocks[0].header.lost_before, frames);
  EXPECT_EQ(sink.dropped_extraction(), 2u * frames);
}

TEST(BlockSink, MarksOfDroppedBlocksTravelWithTheNext) {
  BlockSink sink(1, block_bytes, WhenFull::drop);
  Source source(sink);
  source.push();
  for (std::uint64_t i = 0; i < 5; ++i) {  // 20 marks dropped: more than a block carries
    source.push({line_at(100 + 4 * i), line_at(101 + 4 * i), line_at(102 + 4 * i), line_at(103 + 4 * i)});
  }
  std::vector<std::uint64_t> seen;
  for (int round = 0; round < 3; ++round) {
    take_all(sink.extraction(), sink);
    source.push({line_at(200 + static_cast<std::uint64_t>(round))});
    for (const StreamMark& mark : sink.extraction().front()->header.valid_marks())
      seen.push_back(mark.sample);
  }
  ASSERT_EQ(seen.size(), 23u);
  for (std::uint64_t i = 0; i < 20; ++i) EXPECT_EQ(seen[i], 100 + i);
  for (std::uint64_t i = 0; i < 3; ++i) EXPECT_EQ(seen[20 + i], 200 + i);
  EXPECT_EQ(sink.lost_marks_extraction(), 0u);
}

TEST(BlockSink, MarksThatCannotBeDeliveredAreCounted) {
  BlockSink sink(1, block_bytes, WhenFull::drop);
  Source source(sink);
  source.push();
  const std::size_t pushed = BlockSink::carried_marks + 10;
  for (std::size_t i = 0; i < pushed; ++i) source.push({line_at(i)});
  EXPECT_EQ(sink.lost_marks_extraction(), 10u);
  EXPECT_EQ(sink.lost_marks_recorder(), 0u);
  sink.close();
  EXPECT_EQ(sink.lost_marks_extraction(), pushed);
}

TEST(BlockSink, RecorderSeesWhatComesAfterItsStart) {
  BlockSink sink(2, block_bytes, WhenFull::drop);
  Source source(sink);
  for (int i = 0; i < 5; ++i) source.push({line_at(1)}, 2);
  EXPECT_EQ(sink.recorder().front(), nullptr);
  EXPECT_EQ(sink.dropped_recorder(), 0u);
  sink.start_recording();
  const std::uint64_t first = source.next() + 7;
  source.push({line_at(first)}, 7);
  source.push();
  source.push();  // dropped at the recorder
  auto blocks = take_all(sink.recorder(), sink);
  ASSERT_EQ(blocks.size(), 2u);
  EXPECT_EQ(blocks[0].header.first_sample, first);
  EXPECT_EQ(blocks[0].header.lost_before, 0u);
  EXPECT_EQ(blocks[0].header.mark_count, 1u);
  EXPECT_EQ(sink.dropped_recorder(), frames);
  source.push();
  EXPECT_EQ(sink.recorder().front()->header.lost_before, frames);
  take_all(sink.recorder(), sink);
  source.push({line_at(1)});
  sink.stop_recording();
  source.push({line_at(2)});
  take_all(sink.recorder(), sink);
  sink.start_recording();
  source.push();
  blocks = take_all(sink.recorder(), sink);
  ASSERT_EQ(blocks.size(), 1u);
  EXPECT_EQ(blocks[0].header.lost_before, 0u);
  EXPECT_EQ(blocks[0].header.mark_count, 0u);
}

TEST(BlockSink, TooLongABlockIsALossNotAnOverrun) {
  BlockSink sink(2, block_bytes - 1, WhenFull::wait);
  Source source(sink);
  EXPECT_FALSE(source.push());
  EXPECT_EQ(sink.dropped_extraction(), frames);
}

TEST(BlockSink, CancelDropsFromNowOn) {
  BlockSink sink(2, block_bytes, WhenFull::wait);
  Source source(sink);
  sink.cancel();
  EXPECT_FALSE(source.push());
  EXPECT_EQ(sink.dropped_extraction(), frames);
  sink.wait_extraction();  // returns
  sink.wait_recorder();
}

// The waits below end only if the wake-up arrives: a lost one hangs the test until ctest's timeout.
enum class Release : std::uint8_t { cancel, stop_waiting, consume };

class BlockSinkWait : public testing::TestWithParam<Release> {};

TEST_P(BlockSinkWait, EndsForASourceThatWaitsForRoom) {
  BlockSink sink(1, block_bytes, WhenFull::wait);
  Source source(sink);
  source.push();
  std::atomic<bool> waits{true};
  bool delivered = false;
  std::thread thread([&] {
    delivered = source.push();
    waits.store(false);
  });
  std::this_thread::sleep_for(std::chrono::milliseconds(5));
  EXPECT_TRUE(waits.load());
  switch (GetParam()) {
    case Release::cancel:
      sink.cancel();
      break;
    case Release::stop_waiting:
      sink.stop_waiting();
      break;
    case Release::consume:
      take_all(sink.extraction(), sink);
      break;
  }
  thread.join();
  EXPECT_EQ(delivered, GetParam() == Release::consume);
}

INSTANTIATE_TEST_SUITE_P(EveryWay, BlockSinkWait,
                         testing::Values(Release::cancel, Release::stop_waiting, Release::consume));

TEST(BlockSink, EndOfRecordingReleasesASourceThatWaitsForTheRecorder) {
  BlockSink sink(1, block_bytes, WhenFull::wait);
  Source source(sink);
  sink.start_recording();
  source.push();
  take_all(sink.extraction(), sink);
  std::thread thread([&] { EXPECT_TRUE(source.push()); });
  std::this_thread::sleep_for(std::chrono::milliseconds(5));
  sink.stop_recording();
  thread.join();
  EXPECT_EQ(sink.dropped_recorder(), frames);
}

// Analysis and recording end at the same sample.
TEST(BlockSink, WhatASourceStillHeldWhenItWasStoppedIsNotRecorded) {
  BlockSink sink(1, block_bytes, WhenFull::wait);
  Source source(sink);
  sink.start_recording();
  source.push();
  take_all(sink.recorder(), sink);
  sink.stop_waiting();
  EXPECT_FALSE(source.push());
  EXPECT_EQ(sink.recorder().filled(), 0U);
  EXPECT_EQ(sink.next_sample(), frames);
}

struct Seen {
  std::uint64_t blocks = 0, frames = 0, lost = 0, marks = 0, broken = 0;
};

// Drains a ring to the end of the stream, checking the sample-index rule and every sample.
Seen consume(BlockSink& sink, SampleRing& ring, void (BlockSink::*wait)(), unsigned pause_every) {
  Seen seen;
  std::uint64_t next = 0;
  for (;;) {
    (sink.*wait)();
    const bool last = sink.closed();
    while (const SampleBlock* block = ring.front()) {
      const BlockHeader& header = block->header;
      if (seen.blocks > 0 && header.first_sample != next + header.lost_before) ++seen.broken;
      for (std::uint32_t i = 0; i < header.frames; ++i) {
        if (block->i16()[i] != static_cast<std::int16_t>((header.first_sample + i) & 0x7fff)) ++seen.broken;
      }
      next = header.first_sample + header.frames;
      seen.lost += header.lost_before;
      seen.frames += header.frames;
      seen.marks += header.mark_count;
      ++seen.blocks;
      ring.release();
      sink.released();
      if (seen.blocks % pause_every == 0) std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
    if (last) return seen;
  }
}

class BlockSinkThreads : public testing::TestWithParam<WhenFull> {};

TEST_P(BlockSinkThreads, AccountsForEveryFrameAndMarkAtEachSeam) {
  constexpr std::uint64_t blocks = 20000;
  BlockSink sink(4, block_bytes, GetParam());
  sink.start_recording();
  Seen extracted, recorded;
  std::thread extraction(
      [&] { extracted = consume(sink, sink.extraction(), &BlockSink::wait_extraction, 53); });
  std::thread recorder([&] { recorded = consume(sink, sink.recorder(), &BlockSink::wait_recorder, 31); });
  Source source(sink);
  source.push();  // both consumers know where the stream begins
  for (std::uint64_t i = 1; i < blocks; ++i) {
    std::vector<StreamMark> marks;
    if (i % 40 == 0) marks.push_back(line_at(source.next()));
    source.push(marks);
    if (GetParam() == WhenFull::drop && i % 16 == 0) std::this_thread::yield();
  }
  sink.close();
  extraction.join();
  recorder.join();
  const std::uint64_t total = source.next(), marks = (blocks - 1) / 40;
  EXPECT_EQ(extracted.broken, 0u);
  EXPECT_EQ(recorded.broken, 0u);
  EXPECT_EQ(extracted.frames + sink.dropped_extraction(), total);
  EXPECT_EQ(recorded.frames + sink.dropped_recorder(), total);
  EXPECT_EQ(extracted.marks + sink.lost_marks_extraction(), marks);
  EXPECT_EQ(recorded.marks + sink.lost_marks_recorder(), marks);
  if (GetParam() == WhenFull::wait) {
    EXPECT_EQ(extracted.frames, total);
    EXPECT_EQ(recorded.frames, total);
  }
}

INSTANTIATE_TEST_SUITE_P(Policies, BlockSinkThreads, testing::Values(WhenFull::drop, WhenFull::wait));

}  // namespace
}  // namespace combforce

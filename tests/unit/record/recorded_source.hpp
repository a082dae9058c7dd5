// A source whose codes tell their place in the stream, and the check that a replay puts every sample where it
// was.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "drivers/block_sink.hpp"
#include "drivers/digitizer.hpp"
#include "drivers/replay/replay_digitizer.hpp"
#include "tests/support/digitizer_run.hpp"

namespace combforce::test {

inline constexpr std::uint32_t source_frames = 64;

inline StreamInfo source_info(WhenFull when_full = WhenFull::wait) {
  StreamInfo info;
  info.sample_rate_hz = 1e6;
  info.channels.resize(2);
  info.channels[0].name = "deflection";
  info.channels[1].name = "z";
  info.channels[1].role = ChannelRole::z;
  info.block_frames = source_frames;
  info.when_full = when_full;
  return info;
}

// Code of a channel at stream sample n. Period 65521 (prime): a block moved by any multiple of the block
// length shows.
inline std::int16_t source_code(std::uint64_t n, std::size_t channel) {
  return static_cast<std::int16_t>(static_cast<std::int64_t>((n * 7919 + channel * 31) % 65521) - 32760);
}

class RecordedSource {
 public:
  explicit RecordedSource(BlockSink& sink, std::uint64_t first_sample = 0)
      : sink_(&sink), next_(first_sample) {}

  bool push(const std::vector<StreamMark>& marks = {}) {
    header_.first_sample = next_;
    header_.frames = source_frames;
    header_.channels = 2;
    header_.mark_count = 0;
    for (const StreamMark& mark : marks) header_.marks.at(header_.mark_count++) = mark;
    codes_.clear();
    for (std::uint64_t n = next_; n < next_ + source_frames; ++n)
      for (std::size_t channel = 0; channel < 2; ++channel) codes_.push_back(source_code(n, channel));
    next_ += source_frames;
    const bool delivered = sink_->push(header_, codes_.data());
    header_.lost_before = 0;
    while (sink_->extraction().front() != nullptr) {  // this thread is the extraction as well
      sink_->extraction().release();
      sink_->released();
    }
    return delivered;
  }
  void lose(std::uint64_t frames) {
    next_ += frames;
    header_.lost_before += frames;
  }
  void break_clock() {
    ++header_.epoch;
    header_.epoch_reason = EpochReason::device_restart;
    header_.epoch_first_sample = next_;
    header_.lost_before = 0;
  }
  std::uint64_t next() const { return next_; }

 private:
  BlockSink* sink_;
  std::uint64_t next_;
  BlockHeader header_;
  std::vector<std::int16_t> codes_;
};

// Replays `recording`; every code must be that of the place the replay gives it. Returns the blocks.
inline std::vector<SampleBlock> replay_and_check(const std::string& recording) {
  ReplayDigitizer digitizer(recording);
  const std::vector<SampleBlock> blocks = run_to_end(digitizer);
  EXPECT_EQ(digitizer.status().state, StreamState::ended) << digitizer.status().reason;
  std::uint64_t misplaced = 0;
  for (const SampleBlock& block : blocks) {
    for (std::uint32_t i = 0; i < block.header.frames; ++i)
      for (std::size_t channel = 0; channel < 2; ++channel)
        misplaced +=
            block.i16()[std::size_t{2} * i + channel] != source_code(block.header.first_sample + i, channel)
                ? 1
                : 0;
  }
  EXPECT_EQ(misplaced, 0u);
  return blocks;
}

}  // namespace combforce::test

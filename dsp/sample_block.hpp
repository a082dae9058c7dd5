// One contiguous run of digitizer frames: the unit in which the stream travels.
//
// The only clock of the instrument is the sample index: it counts frames (one sample of every channel) since
// the stream started and refers to the digitizer's clock, never to the host's. Within an epoch
//     next.first_sample == first_sample + frames + next.lost_before
// holds for successive blocks. A loss of unknown length, or any other break of the clock, starts a new epoch
// with a reason: phases measured before and after it have no common reference.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "dsp/scan.hpp"

namespace combforce {

enum class SampleFormat : std::uint8_t { i16, f32 };

constexpr std::size_t sample_bytes(SampleFormat format) {
  return format == SampleFormat::i16 ? sizeof(std::int16_t) : sizeof(float);
}

// Why an epoch began. `start` belongs to epoch 0 alone.
enum class EpochReason : std::uint8_t { start, unknown_loss, device_restart, clock_change };

// Something that happens at a known sample and travels with the block that contains it, so that what
// processes the stream learns of it in order and deterministically.
struct StreamMark {
  enum class Kind : std::uint8_t {
    line,       // a scan line begins: `line` is valid
    step,       // drive or set-point changed at `sample`: transients follow
    scan_ended  // no line follows until the next scan: `sample` is the first one after it
  };
  Kind kind = Kind::line;
  std::uint64_t sample = 0;
  LineMark line;
};

// Everything about a block but its samples. Plain data; copied, never shared.
struct BlockHeader {
  static constexpr std::size_t max_marks = 16;

  std::uint32_t epoch = 0;
  EpochReason epoch_reason = EpochReason::start;  // why `epoch` began
  std::uint64_t epoch_first_sample = 0;           // where it began: a phase reference from before is void
  std::uint64_t first_sample = 0;
  std::uint32_t frames = 0;
  std::uint16_t channels = 1;
  SampleFormat format = SampleFormat::i16;
  std::uint64_t lost_before = 0;  // frames lost between the previous block and this one, all causes
  std::array<StreamMark, max_marks> marks{};  // the first mark_count are valid, ordered by sample
  std::uint32_t mark_count = 0;

  std::span<const StreamMark> valid_marks() const { return {marks.data(), mark_count}; }
  std::size_t bytes() const { return std::size_t{frames} * channels * sample_bytes(format); }
};

// A block with its samples: frames interleaved by channel, host byte order. Storage is allocated once, by
// the constructor; the real-time path only refills it.
struct SampleBlock {
  BlockHeader header;
  std::vector<std::byte> storage;  // at least header.bytes() long

  explicit SampleBlock(std::size_t capacity_bytes = 0) : storage(capacity_bytes) {}

  // Valid when header.format is i16, or f32, respectively.
  std::span<const std::int16_t> i16() const {
    return {reinterpret_cast<const std::int16_t*>(storage.data()),
            std::size_t{header.frames} * header.channels};
  }
  std::span<const float> f32() const {
    return {reinterpret_cast<const float*>(storage.data()), std::size_t{header.frames} * header.channels};
  }
};

}  // namespace combforce

// The digitizer around the sample source: life, threads, faults. Nothing here bounds a time: what hangs fails
// by the runner's timeout.
#include "drivers/simulated/simulated_digitizer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <span>
#include <stdexcept>

#include "tests/unit/drivers/simulated_instrument.hpp"

namespace combforce::test {

constexpr std::size_t slots = 8;

struct Captured {
  std::vector<BlockHeader> headers;
  std::vector<std::vector<std::int16_t>> codes;
  StreamStatus status;

  std::vector<StreamMark> marks() const {
    std::vector<StreamMark> all;
    for (const BlockHeader& header : headers) {
      all.insert(all.end(), header.valid_marks().begin(), header.valid_marks().end());
    }
    return all;
  }
};

// Blocks until `last` says so of one, in which case it is the last.
Captured capture(SimulatedDigitizer& digitizer, const std::function<bool(const BlockHeader&)>& last) {
  const StreamInfo& info = digitizer.info();
  BlockSink sink(slots, info.block_frames * info.channels.size() * sample_bytes(info.format), info.when_full);
  digitizer.start(sink);
  Captured captured;
  bool done = false;
  while (!done) {
    sink.wait_extraction();
    const SampleBlock* block = sink.extraction().front();
    if (block == nullptr) break;
    captured.headers.push_back(block->header);
    captured.codes.emplace_back(block->i16().begin(), block->i16().end());
    done = last(block->header);
    sink.extraction().release();
    sink.released();
  }
  captured.status = digitizer.status();
  digitizer.stop();
  return captured;
}

std::function<bool(const BlockHeader&)> until(std::uint64_t sample) {
  return [sample](const BlockHeader& header) { return header.first_sample + header.frames >= sample; };
}

bool scan_ended(const BlockHeader& header) {
  const auto marks = header.valid_marks();
  return std::ranges::any_of(
      marks, [](const StreamMark& mark) { return mark.kind == StreamMark::Kind::scan_ended; });
}

void expect_contiguous(const Captured& captured) {
  for (std::size_t i = 1; i < captured.headers.size(); ++i) {
    const BlockHeader &before = captured.headers[i - 1], &block = captured.headers[i];
    if (block.epoch != before.epoch) continue;
    EXPECT_EQ(block.first_sample, before.first_sample + before.frames + block.lost_before) << "block " << i;
  }
}

// The same instrument without faults, by stream sample.
std::vector<std::int16_t> undisturbed(SimulationSettings settings, std::uint64_t frames, bool scan) {
  settings.faults.clear();
  SampleSource source(settings);
  if (scan) source.start_scan(small_layout(), 1, make_scene(settings.scene, source.model(), small_layout()));
  std::vector<std::int16_t> codes;
  while (source.next_sample() < frames) {
    BlockHeader header;
    source.append(1000, header, codes);
  }
  return codes;
}

bool same_codes(const std::vector<std::int16_t>& block, const std::vector<std::int16_t>& stream,
                std::uint64_t first_sample) {
  return std::ranges::equal(block, std::span(stream).subspan(2 * first_sample, block.size()));
}

TEST(SimulatedDigitizer, DeliversContiguousBlocksOfItsSource) {
  const SimulationSettings settings = small_instrument();
  SimulatedDigitizer digitizer(settings);
  EXPECT_EQ(digitizer.status().state, StreamState::idle);
  EXPECT_EQ(digitizer.info().when_full, WhenFull::wait);
  EXPECT_EQ(digitizer.info().channels.size(), 2U);
  const Captured captured = capture(digitizer, until(50000));
  expect_contiguous(captured);
  EXPECT_EQ(captured.headers[0].first_sample, 0U);
  const std::vector<std::int16_t> expected = undisturbed(settings, 60000, false);
  for (std::size_t i = 0; i < captured.headers.size(); ++i) {
    EXPECT_EQ(captured.headers[i].frames, 1000U);
    EXPECT_TRUE(same_codes(captured.codes[i], expected, captured.headers[i].first_sample));
  }
  EXPECT_GT(captured.status.realtime_factor, 0.0);
  EXPECT_EQ(captured.status.state, StreamState::running);
  EXPECT_EQ(digitizer.status().state, StreamState::ended);
}

TEST(SimulatedDigitizer, ScanAskedForBeforeStartBeginsAtItsSample) {
  SimulationSettings settings = small_instrument();
  settings.free_seconds = 0.00525;  // sample 10500, within a block of 1000
  SimulatedDigitizer digitizer(settings);
  digitizer.start_scan(small_layout(), 1);
  EXPECT_TRUE(digitizer.status().scanning);
  EXPECT_THROW(digitizer.start_scan(small_layout(), 1), std::logic_error);
  const Captured captured = capture(digitizer, scan_ended);
  expect_contiguous(captured);
  const std::vector<StreamMark> marks = captured.marks();
  ASSERT_EQ(marks.size(), 4U);
  for (std::uint64_t line = 0; line < 3; ++line)
    EXPECT_EQ(marks[line].sample, 10500 + 8 * 4000 + line * 20000);
  EXPECT_EQ(marks[3].sample, 10500U + 8 * 4000 + 3 * 20000);
}

TEST(SimulatedDigitizer, ScanAskedForLaterRunsAndEnds) {
  SimulatedDigitizer digitizer(small_instrument());
  bool asked = false;
  const Captured captured = capture(digitizer, [&](const BlockHeader& header) {
    if (!asked) digitizer.start_scan(small_layout(), 2);
    asked = true;
    return scan_ended(header);
  });
  expect_contiguous(captured);
  EXPECT_EQ(captured.marks().size(), 7U);
}

TEST(SimulatedDigitizer, TruthComesForEveryPixel) {
  SimulatedDigitizer digitizer(small_instrument());
  std::vector<std::uint64_t> first_samples;
  digitizer.set_truth_sink([&](const PixelTruth& truth) { first_samples.push_back(truth.first_sample); });
  digitizer.start_scan(small_layout(), 1);
  capture(digitizer, scan_ended);
  ASSERT_EQ(first_samples.size(), 15U);
  for (std::size_t i = 0; i < 15; ++i) EXPECT_EQ(first_samples[i], (8 + i) * 4000);
}

TEST(SimulatedDigitizer, LostBlockIsAKnownLossAndItsMarksArriveAfterIt) {
  SimulationSettings settings = small_instrument();
  const std::uint64_t lost_first = 51500, lost_frames = 2250;  // the second line begins at 52000
  settings.faults = {{FaultSettings::Kind::lost_block, lost_first, lost_frames, 0.0}};
  SimulatedDigitizer digitizer(settings);
  digitizer.start_scan(small_layout(), 1);
  const Captured captured = capture(digitizer, scan_ended);
  expect_contiguous(captured);
  const std::vector<std::int16_t> expected = undisturbed(settings, 100000, true);
  std::uint64_t lost = 0;
  for (std::size_t i = 0; i < captured.headers.size(); ++i) {
    const BlockHeader& header = captured.headers[i];
    EXPECT_EQ(header.epoch, 0U);
    EXPECT_TRUE(same_codes(captured.codes[i], expected, header.first_sample)) << "block " << i;
    lost += header.lost_before;
    if (header.lost_before == 0) continue;
    EXPECT_EQ(header.first_sample, lost_first + lost_frames);
    ASSERT_EQ(header.mark_count, 1U);
    EXPECT_EQ(header.marks[0].line.first_sample, 52000U);
  }
  EXPECT_EQ(lost, lost_frames);
  EXPECT_EQ(captured.status.lost_frames, lost_frames);
  EXPECT_EQ(captured.marks().size(), 4U);
}

// Forty lines lost at once: their marks do not fit one block.
TEST(SimulatedDigitizer, ManyLostMarksArriveInOrder) {
  SimulationSettings settings = small_instrument();
  settings.faults = {{FaultSettings::Kind::lost_block, 31000, 41UL * 4000, 0.0}};
  SimulatedDigitizer digitizer(settings);
  ScanLayout layout = small_layout();
  layout.columns = 1;
  layout.lines = 50;
  digitizer.start_scan(layout, 1);
  const Captured captured = capture(digitizer, scan_ended);
  expect_contiguous(captured);
  const std::vector<StreamMark> marks = captured.marks();
  ASSERT_EQ(marks.size(), 51U);
  for (std::size_t i = 0; i < 50; ++i) EXPECT_EQ(marks[i].line.line, i);
}

TEST(SimulatedDigitizer, UnknownLossIsANewEpochThatCountsOn) {
  SimulationSettings settings = small_instrument();
  settings.faults = {{FaultSettings::Kind::unknown_loss, 5300, 1234, 0.0}};
  SimulatedDigitizer digitizer(settings);
  const Captured captured = capture(digitizer, until(20000));
  const std::vector<std::int16_t> expected = undisturbed(settings, 30000, false);
  std::uint64_t next = 0;
  for (std::size_t i = 0; i < captured.headers.size(); ++i) {
    const BlockHeader& header = captured.headers[i];
    EXPECT_EQ(header.first_sample, next);
    EXPECT_EQ(header.lost_before, 0U);
    const bool after = header.first_sample >= 5300;
    EXPECT_EQ(header.epoch, after ? 1U : 0U);
    EXPECT_EQ(header.epoch_reason, after ? EpochReason::unknown_loss : EpochReason::start);
    EXPECT_TRUE(same_codes(captured.codes[i], expected, header.first_sample + (after ? 1234 : 0)))
        << "block " << i;
    next = header.first_sample + header.frames;
  }
  EXPECT_EQ(captured.status.epoch, 1U);
  EXPECT_EQ(captured.status.lost_frames, 0U);
}

// In the new epoch lines lie where the stream index says; the line that began in the loss is not marked.
TEST(SimulatedDigitizer, LinesAfterAnUnknownLossReferToItsIndex) {
  SimulationSettings settings = small_instrument();
  settings.faults = {{FaultSettings::Kind::unknown_loss, 51500, 1000, 0.0}};
  SimulatedDigitizer digitizer(settings);
  digitizer.start_scan(small_layout(), 1);
  const std::vector<StreamMark> marks = capture(digitizer, scan_ended).marks();
  ASSERT_EQ(marks.size(), 3U);
  EXPECT_EQ(marks[0].line.first_sample, 32000U);
  EXPECT_EQ(marks[1].line.line, 2U);
  EXPECT_EQ(marks[1].sample, 72000U - 1000);
  EXPECT_EQ(marks[1].line.first_sample, 72000U - 1000);
  EXPECT_EQ(marks[2].sample, 92000U - 1000);
}

TEST(SimulatedDigitizer, StallLosesNothing) {
  SimulationSettings settings = small_instrument();
  settings.faults = {{FaultSettings::Kind::stall, 5500, 0, 0.3}};
  SimulatedDigitizer digitizer(settings);
  const Captured captured = capture(digitizer, until(20000));
  expect_contiguous(captured);
  const std::vector<std::int16_t> expected = undisturbed(settings, 30000, false);
  for (std::size_t i = 0; i < captured.headers.size(); ++i) {
    EXPECT_EQ(captured.headers[i].lost_before, 0U);
    EXPECT_TRUE(same_codes(captured.codes[i], expected, captured.headers[i].first_sample));
  }
  // Twenty thousand samples last 10 ms, and 300 were waited for: slower than real time by arithmetic, also
  // when it ran on for some before it was stopped.
  EXPECT_LT(captured.status.realtime_factor, 0.25);
}

// A block is delivered when its last sample is due, never before.
TEST(SimulatedDigitizer, PacedStreamIsNeverAheadOfRealTime) {
  SimulationSettings settings = small_instrument();
  settings.paced = true;
  SimulatedDigitizer digitizer(settings);
  EXPECT_EQ(digitizer.info().when_full, WhenFull::drop);
  const Captured captured = capture(digitizer, until(40000));
  EXPECT_GT(captured.status.realtime_factor, 0.0);
  EXPECT_LE(captured.status.realtime_factor, 1.0);
}

TEST(SimulatedDigitizer, StopsWhileItsSinkIsFull) {
  const SimulationSettings settings = small_instrument();
  SimulatedDigitizer digitizer(settings);
  BlockSink sink(slots, std::size_t{4} * settings.block_frames, WhenFull::wait);
  digitizer.start(sink);
  while (sink.extraction().filled() < slots) sink.wait_extraction();
  digitizer.stop();
  EXPECT_TRUE(sink.closed());
  EXPECT_EQ(digitizer.status().state, StreamState::ended);
  digitizer.stop();
}

TEST(SimulatedDigitizer, StopsWhileStalled) {
  SimulationSettings settings = small_instrument();
  settings.faults = {{FaultSettings::Kind::stall, 0, 0, 3600.0}};
  SimulatedDigitizer digitizer(settings);
  BlockSink sink(slots, std::size_t{4} * settings.block_frames, WhenFull::wait);
  digitizer.start(sink);
  digitizer.stop();
  EXPECT_TRUE(sink.closed());
}

TEST(SimulatedDigitizer, RunsOnce) {
  const SimulationSettings settings = small_instrument();
  SimulatedDigitizer digitizer(settings);
  BlockSink sink(slots, std::size_t{4} * settings.block_frames, WhenFull::wait);
  digitizer.start(sink);
  EXPECT_THROW(digitizer.start(sink), std::logic_error);
  digitizer.stop();
  EXPECT_THROW(digitizer.start(sink), std::logic_error);
  SimulatedDigitizer never_started(settings);
  never_started.stop();
  EXPECT_EQ(never_started.status().state, StreamState::ended);
}

TEST(SimulatedDigitizer, ControlsRefuseWhatDoesNotFit) {
  SimulatedDigitizer digitizer(small_instrument());
  ScanLayout layout = small_layout();
  layout.pixel_samples = 100;
  EXPECT_THROW(digitizer.prepare_scan(layout), std::invalid_argument);
  EXPECT_THROW(digitizer.start_scan(layout, 1), std::invalid_argument);
  EXPECT_FALSE(digitizer.status().scanning);
  digitizer.prepare_scan(small_layout());
  EXPECT_FALSE(digitizer.status().scanning) << "prepared is not begun";
  Drive drive;
  drive.scheme = DriveScheme::amplitudes;
  drive.amplitudes_nm = {1.0, 2.0};
  EXPECT_THROW(digitizer.set_drive(drive), std::invalid_argument);
  EXPECT_EQ(digitizer.drive(), small_instrument().drive);
  drive.amplitudes_nm = {10.0};
  digitizer.set_drive(drive);
  EXPECT_EQ(digitizer.drive(), drive);
}

}  // namespace combforce::test

// Pixels from a stream to which things happen: losses, broken clocks, cut lines. No fits here.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <set>
#include <thread>

#include "dsp/pixel_clock.hpp"
#include "tests/support/synthetic_stream.hpp"

namespace combforce {
namespace {

using test::one_channel;
using test::Range;
using test::Recorded;
using test::run;
using test::SyntheticStream;

constexpr std::uint64_t window = 200;

Description description(std::uint32_t lines, std::uint32_t columns, std::uint64_t pixel_samples,
                        std::uint64_t settle, std::uint32_t windows, bool bidirectional = false) {
  Description result;
  result.comb = Comb{window, {{7, true}, {31, true}}};
  ScanLayout layout;
  layout.lines = lines;
  layout.columns = columns;
  layout.pixel_samples = pixel_samples;
  layout.settle_samples = settle;
  layout.windows = windows;
  layout.bidirectional = bidirectional;
  result.scan = layout;
  return result;
}

// Amplitudes 5000 and 800 codes at bins 7 and 31, phases 0.3 and -1.1 at sample 0.
std::int16_t two_tones(std::uint64_t n) {
  const double t = 2.0 * std::numbers::pi * static_cast<double>(n % window) / static_cast<double>(window);
  return static_cast<std::int16_t>(
      std::lround(5000.0 * std::cos(7.0 * t + 0.3) + 800.0 * std::cos(31.0 * t - 1.1)));
}

StreamMark line_mark(std::uint32_t frame, std::uint32_t line, Direction direction, std::uint64_t first,
                     std::uint64_t samples) {
  StreamMark mark;
  mark.sample = first;
  mark.line = {frame, line, direction, first, samples};
  return mark;
}

std::function<std::uint32_t()> sizes(std::uint32_t seed, std::uint32_t largest) {
  return [random = std::mt19937(seed), largest]() mutable {
    return 1 + static_cast<std::uint32_t>(random() % largest);
  };
}

// What waits in the ring when the stream has ended, at the end of a measurement that is stopped.
Recorded stopped_after_the_end(std::chrono::milliseconds drain) {
  SyntheticStream stream;
  stream.samples = 60000;
  stream.value = two_tones;
  stream.marks.push_back(line_mark(0, 0, Direction::trace, 0, 60000));
  StreamInfo info = one_channel(1e6, 512);
  info.when_full = WhenFull::drop;
  BlockSink sink(128, 512 * sizeof(std::int16_t), info.when_full);
  stream.push_into(sink, [] { return 512U; });
  Recorded recorded;
  Pipeline pipeline(info, sink, {}, description(1, 100, 600, 100, 2), {}, recorded.outputs());
  pipeline.start();
  while (pipeline.status().next_sample == 0) std::this_thread::yield();
  pipeline.stop(drain);
  return recorded;
}

TEST(Extraction, WhatTheRingHoldsAtTheEndOfTheStreamIsAnalysed) {
  const Recorded recorded = stopped_after_the_end(std::chrono::minutes(1));
  EXPECT_EQ(recorded.pixels.size(), 100U);
  ASSERT_FALSE(recorded.events.empty());
  EXPECT_EQ(recorded.events.back().kind, "stream_ended");
  EXPECT_EQ(recorded.events.back().first_sample, 60000U);
  EXPECT_EQ(recorded.events.back().count, 0U);
}

TEST(Extraction, WhatThereWasNoTimeToAnalyseIsCounted) {
  const Recorded recorded = stopped_after_the_end(std::chrono::milliseconds(0));
  ASSERT_FALSE(recorded.events.empty());
  const Event& end = recorded.events.back();
  EXPECT_EQ(end.kind, "stream_ended");
  EXPECT_EQ(end.first_sample + end.count, 60000U);
  EXPECT_EQ(end.text.empty(), end.count == 0) << end.text;
}

TEST(Extraction, MeasuresTheTonesOfEveryPixelOfMarkedLines) {
  SyntheticStream stream;
  stream.first_sample = 12345;
  stream.samples = 60000;
  stream.value = two_tones;
  for (std::uint32_t line = 0; line < 3; ++line) {
    stream.marks.push_back(line_mark(0, line, Direction::trace, 15000 + 12000 * line, 5007));
    stream.marks.push_back(line_mark(0, line, Direction::retrace, 20500 + 12000 * line, 5007));
  }
  const Recorded recorded =
      run(stream, one_channel(1e6, 512), description(3, 10, 500, 100, 2, true), sizes(1, 512));
  ASSERT_EQ(recorded.pixels.size(), 60U);
  for (std::size_t i = 0; i < recorded.pixels.size(); ++i) {
    const Pixel& pixel = recorded.pixels[i];
    const bool retrace = i / 10 % 2 == 1;
    EXPECT_EQ(pixel.span.line, i / 20);
    EXPECT_EQ(pixel.span.column, retrace ? 9 - i % 10 : i % 10);
    EXPECT_EQ(pixel.span.direction, retrace ? Direction::retrace : Direction::trace);
    EXPECT_FALSE(pixel.flags.any());
    // Quantisation of 1 code, variance 1/12, over 400 samples: 0.02 codes a quadrature; 0.1 is five times
    // that.
    EXPECT_NEAR(std::abs(pixel.phasors[0] - std::polar(5000.0, 0.3)), 0.0, 0.1) << i;
    EXPECT_NEAR(std::abs(pixel.phasors[1] - std::polar(800.0, -1.1)), 0.0, 0.1) << i;
    EXPECT_EQ(recorded.fits[i].status, FitStatus::no_free_response);
  }
  ASSERT_EQ(recorded.frame_ends.size(), 1U);
  EXPECT_EQ(recorded.frame_ends[0].counts.pixels, 60U);
  EXPECT_TRUE(recorded.frame_ends[0].whole);
  EXPECT_EQ(recorded.line_ends.size(), 6U);
  EXPECT_EQ(recorded.order.back(), "stream_ended");
}

TEST(Extraction, CutsOfTheStreamIntoBlocksDoNotMatter) {
  SyntheticStream stream;
  stream.samples = 40000;
  std::mt19937 noise(7);
  std::vector<std::int16_t> values(stream.samples);
  for (auto& value : values) value = static_cast<std::int16_t>(noise());
  stream.value = [&values](std::uint64_t n) { return values[n]; };
  for (std::uint32_t line = 0; line < 4; ++line)
    stream.marks.push_back(line_mark(0, line, Direction::trace, 100 + 9000 * line, 8800));
  const Description how = description(4, 16, 550, 100, 2);
  const std::string whole = run(stream, one_channel(1e6, 40000), how, [] { return 40000U; }).lines;
  EXPECT_EQ(std::ranges::count(whole, '\n'), 64);
  for (std::uint32_t seed = 0; seed < 5; ++seed)
    EXPECT_EQ(run(stream, one_channel(1e6, 700), how, sizes(seed, 700), 1 + seed % 3).lines, whole);
}

// The oracle walks all pixels of all lines and asks which overlap a lost range: no state, no order.
std::set<std::uint64_t> touched(const SyntheticStream& stream, const ScanLayout& layout) {
  std::set<std::uint64_t> result;
  for (const StreamMark& mark : stream.marks)
    for (std::uint32_t j = 0; j < layout.columns; ++j) {
      const std::uint64_t first = mark.line.first_sample + j * mark.line.line_samples / layout.columns;
      const std::uint64_t end = mark.line.first_sample + (j + 1) * mark.line.line_samples / layout.columns;
      for (const Range& range : stream.lost)
        if (range.first < end && range.end > first) result.insert(first);
    }
  return result;
}

TEST(Extraction, LostSamplesFlagExactlyThePixelsTheyTouch) {
  for (std::uint32_t seed = 0; seed < 40; ++seed) {
    std::mt19937 random(seed);
    SyntheticStream stream;
    stream.samples = 60000;
    stream.value = two_tones;
    for (std::uint32_t line = 0; line < 5; ++line)
      stream.marks.push_back(
          line_mark(0, line, Direction::trace, 1000 + 11000 * line, 10000 + random() % 1000));
    std::uint64_t at = 1;
    while ((at += random() % 9000) < 57000) {
      const std::uint64_t end = at + 1 + random() % (seed % 2 == 0 ? 300 : 14000);
      stream.lost.push_back({at, std::min<std::uint64_t>(end, 59000)});
      at = stream.lost.back().end;
      if (at >= 59000) break;
    }
    const Description how = description(5, 20, 500, 100, 2);
    const Recorded recorded = run(stream, one_channel(1e6, 512), how, sizes(seed, 512));
    ASSERT_EQ(recorded.pixels.size(), 100U) << "seed " << seed;
    const std::set<std::uint64_t> expected = touched(stream, *how.scan);
    for (const Pixel& pixel : recorded.pixels) {
      EXPECT_EQ(pixel.flags.has(PixelFlag::gap), expected.contains(pixel.span.first_sample))
          << "seed " << seed << ", pixel at " << pixel.span.first_sample;
      EXPECT_EQ(std::isnan(pixel.phasors[0].real()), pixel.flags.has(PixelFlag::gap));
      if (!pixel.flags.any()) {
        EXPECT_NEAR(std::abs(pixel.phasors[0]), 5000.0, 0.1);
      }
    }
    std::uint64_t lost = 0, reported = 0;
    for (const Range& range : stream.lost) lost += range.end - range.first;
    for (const Event& event : recorded.events)
      if (event.kind == "gap") reported += event.count;
    EXPECT_EQ(reported, lost);
  }
}

TEST(Extraction, UnmarkedRecordingIsOneRowOfWholeWindows) {
  SyntheticStream stream;
  stream.samples = 10 * window + window / 2;
  stream.value = two_tones;
  stream.lost = {{3 * window + 10, 3 * window + 20}, {5 * window - 1, 7 * window + 1}};
  StreamInfo info = one_channel(1e6, 512);
  info.marks_lines = false;
  Description how;
  how.comb = Comb{window, {{7, true}, {31, true}}};
  const Recorded recorded = run(stream, info, how, sizes(3, 512));
  ASSERT_EQ(recorded.pixels.size(), 10U) << "the half window at the end is no pixel";
  const std::set<std::uint32_t> gaps{3, 4, 5, 6, 7};
  for (const Pixel& pixel : recorded.pixels) {
    EXPECT_EQ(pixel.span.line, 0U);
    EXPECT_EQ(pixel.flags.has(PixelFlag::gap), gaps.contains(pixel.span.column)) << pixel.span.column;
  }
}

TEST(Extraction, AHugeGapInAnUnmarkedRecordingEndsInBoundedTime) {
  SyntheticStream stream;
  constexpr std::uint64_t far = std::uint64_t{1} << 40;
  stream.samples = far + 10 * window;
  stream.lost = {{3 * window, far}};
  stream.value = two_tones;
  StreamInfo info = one_channel(1e6, 512);
  info.marks_lines = false;
  Description how;
  how.comb = Comb{window, {{7, true}}};
  const Recorded recorded = run(stream, info, how, sizes(3, 512));
  EXPECT_LT(recorded.pixels.size(), 5000U);
  EXPECT_FALSE(recorded.pixels.back().flags.any());
  EXPECT_EQ(recorded.pixels.back().span.end_sample % window, 0U)
      << "the raster goes on where it would have been";
}

TEST(Extraction, ABrokenClockVoidsTheReference) {
  SyntheticStream stream;
  stream.samples = 30000;
  stream.value = two_tones;
  stream.new_epochs = {12250};
  for (std::uint32_t line = 0; line < 3; ++line)
    stream.marks.push_back(line_mark(0, line, Direction::trace, 1000 + 5500 * line, 5000));
  Description how = description(3, 10, 500, 100, 2);
  how.cantilever = Cantilever{{{35000.0, 2.0, 4.0, 1.0}}};
  how.free_response = FreeResponse{0, 1, {{5000.0, 0.0}, {800.0, 0.0}}, std::nullopt};
  FitSettings fit;
  fit.model = "hertz";
  how.fit = fit;
  const Recorded recorded = run(stream, one_channel(1e6, 512), how, sizes(5, 512));
  // Line 2 begins at 12000; the clock breaks in its first pixel, and the rest of the line cannot be placed.
  ASSERT_EQ(recorded.pixels.size(), 21U);
  EXPECT_TRUE(recorded.pixels.back().flags.has(PixelFlag::gap));
  EXPECT_NE(std::ranges::find(recorded.order, "epoch"), recorded.order.end());
}

TEST(Extraction, AStepAndALineStartSettleFirst) {
  SyntheticStream stream;
  stream.samples = 12000;
  stream.value = two_tones;
  stream.marks = {line_mark(0, 0, Direction::trace, 1000, 10000)};
  StreamMark step;
  step.kind = StreamMark::Kind::step;
  step.sample = 6200;
  stream.marks.push_back(step);
  Description how = description(1, 20, 500, 100, 2);
  // tau = Q/(pi f) = 100 samples: a residual of 1 % takes 461 samples; windows begin 100 after a pixel's
  // start.
  how.cantilever = Cantilever{{{31830.98861837907, 10.0, 4.0, 1.0}}};
  const Recorded recorded = run(stream, one_channel(1e6, 512), how, sizes(5, 512));
  ASSERT_EQ(recorded.pixels.size(), 20U);
  for (const Pixel& pixel : recorded.pixels) {
    // Line start at 1000: pixel 0 analyses from 1100 (100 after), pixel 1 from 1600 (600). Step at 6200, in
    // pixel 10 (6000 … 6500, analysed from 6100: in the window); pixel 11 analyses from 6600 (400 after),
    // pixel 12 from 7100.
    const bool settling = pixel.span.column == 0 || pixel.span.column == 10 || pixel.span.column == 11;
    EXPECT_EQ(pixel.flags.has(PixelFlag::settling), settling) << pixel.span.column;
  }
}

TEST(Extraction, LinesTooShortOrCutAreFlagged) {
  SyntheticStream stream;
  stream.samples = 12000;
  stream.value = two_tones;
  stream.marks = {line_mark(0, 0, Direction::trace, 1000, 3000),   // 300 a pixel: no room for 2 windows
                  line_mark(0, 1, Direction::trace, 4500, 5000),   // cut after 2600 samples
                  line_mark(1, 0, Direction::trace, 7100, 5000)};  // the stream ends in it
  const Recorded recorded =
      run(stream, one_channel(1e6, 512), description(2, 10, 500, 100, 2), sizes(5, 512));
  std::size_t short_ones = 0, cut = 0;
  for (const Pixel& pixel : recorded.pixels) {
    short_ones += pixel.span.line == 0 && pixel.span.frame == 0 && pixel.flags.has(PixelFlag::sync) ? 1U : 0U;
    cut += pixel.flags.has(PixelFlag::incomplete) ? 1U : 0U;
  }
  EXPECT_EQ(short_ones, 10U);
  EXPECT_EQ(cut, 2U);
  ASSERT_EQ(recorded.pixels.size(), 10U + 6U + 10U);
  EXPECT_TRUE(recorded.pixels[15].flags.has(PixelFlag::incomplete));
  EXPECT_TRUE(recorded.pixels.back().flags.has(PixelFlag::incomplete));
  ASSERT_EQ(recorded.frame_ends.size(), 2U);
  for (const FrameDone& frame : recorded.frame_ends) EXPECT_FALSE(frame.whole);
}

TEST(Extraction, AScheduledChangeTakesEffectAtThePixelBoundary) {
  SyntheticStream stream;
  stream.samples = 12000;
  stream.value = two_tones;
  stream.marks = {line_mark(0, 0, Direction::trace, 1000, 10000)};
  const Description before = description(1, 20, 500, 100, 2);
  Description after = before;
  after.channels = Channels{Channel{}};
  after.channels->front().scale = 2.0;
  const Recorded recorded = run(stream, one_channel(1e6, 512), before, sizes(5, 512), 1, {{3200, after}});
  ASSERT_EQ(recorded.pixels.size(), 20U);
  for (const Pixel& pixel : recorded.pixels)
    EXPECT_NEAR(std::abs(pixel.phasors[0]), pixel.span.first_sample >= 3500 ? 10000.0 : 5000.0, 0.2);
  EXPECT_EQ(std::ranges::count(recorded.order, "change"), 1);
}

TEST(Extraction, WithoutACantileverTonesAreVoltsTimesTheChannelsLength) {
  SyntheticStream stream;
  stream.samples = 2 * window;
  stream.value = two_tones;
  StreamInfo info = one_channel(1e6, 512);
  info.marks_lines = false;
  Description how;
  how.comb = Comb{window, {{7, true}}};
  how.channels = info.channels;
  how.channels->front().scale = 1e-3;
  for (const std::optional<double> nm_per_v : {std::optional<double>(), std::optional<double>(-20.0)}) {
    how.channels->front().nm_per_v = nm_per_v;
    const Recorded recorded = run(stream, info, how, sizes(3, 512));
    ASSERT_EQ(recorded.tip_nm.size(), 2U);
    // 5 V; quantisation as above, 0.1 codes.
    EXPECT_NEAR(std::abs(recorded.tip_nm[0][0] - nm_per_v.value_or(1.0) * std::polar(5.0, 0.3)), 0.0,
                1e-4 * std::abs(nm_per_v.value_or(1.0)));
    EXPECT_EQ(recorded.fits[0].status, FitStatus::no_free_response);
  }
}

// A reference is good for its epoch; a stream that begins within one says where that began.
TEST(Extraction, AReferenceIsGoodForItsEpoch) {
  SyntheticStream stream;
  stream.samples = 30000;
  stream.value = two_tones;
  stream.new_epochs = {5000};
  stream.marks.push_back(line_mark(0, 0, Direction::trace, 6000, 5000));
  Description how = description(1, 10, 500, 100, 2);
  how.cantilever = Cantilever{{{35000.0, 2.0, 4.0, 1.0}}};
  FitSettings fit;
  fit.model = "hertz";
  how.fit = fit;
  for (const std::uint64_t captured : {4999U, 5000U}) {
    how.free_response = FreeResponse{captured, 1, {{5000.0, 0.0}, {800.0, 0.0}}, std::nullopt};
    const Recorded recorded = run(stream, one_channel(1e6, 512), how, sizes(5, 512));
    ASSERT_EQ(recorded.fits.size(), 10U);
    EXPECT_EQ(recorded.fits.back().status == FitStatus::no_free_response, captured < 5000) << captured;
  }
}

TEST(Extraction, PixelsOfAnIncoherentReferenceAreFlagged) {
  SyntheticStream stream;
  stream.samples = 12000;
  stream.value = two_tones;
  stream.marks.push_back(line_mark(0, 0, Direction::trace, 1000, 5000));
  Description how = description(1, 10, 500, 100, 2);
  how.free_response = FreeResponse{0, 16, {{5000.0, 0.0}, {800.0, 0.0}}, std::nullopt, false};
  const Recorded recorded = run(stream, one_channel(1e6, 512), how, sizes(5, 512));
  ASSERT_EQ(recorded.pixels.size(), 10U);
  for (const Pixel& pixel : recorded.pixels) EXPECT_TRUE(pixel.flags.has(PixelFlag::incoherent));
  EXPECT_EQ(recorded.fits.front().status, FitStatus::flagged);
}

}  // namespace
}  // namespace combforce

#include "dsp/pixel_clock.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

namespace combforce {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr std::uint64_t largest = std::numeric_limits<std::uint64_t>::max();

ScanLayout layout_of(std::uint32_t columns, std::uint64_t pixel_samples, std::uint64_t settle_samples = 0,
                     std::uint32_t windows = 1) {
  ScanLayout layout;
  layout.columns = columns;
  layout.pixel_samples = pixel_samples;
  layout.settle_samples = settle_samples;
  layout.windows = windows;
  return layout;
}

// The rule of the recording contract, in 128 bits.
std::uint64_t start_of(const LineMark& mark, std::uint32_t columns, std::uint64_t j) {
  const auto offset = static_cast<unsigned __int128>(j) * mark.line_samples / columns;
  return mark.first_sample + static_cast<std::uint64_t>(offset);
}

TEST(PixelClock, LayoutIsCheckedByField) {
  const auto refusal = [](ScanLayout layout) { return [layout] { validate(layout, 100); }; };
  EXPECT_NO_THROW(validate(layout_of(1, 100), 100));
  EXPECT_NO_THROW(validate(layout_of(4, 350, 50, 3), 100));
  ScanLayout no_lines = layout_of(4, 100);
  no_lines.lines = 0;
  EXPECT_THAT(refusal(no_lines), ThrowsMessage<std::invalid_argument>(HasSubstr("scan.lines: 0")));
  EXPECT_THAT(refusal(layout_of(0, 100)), ThrowsMessage<std::invalid_argument>(HasSubstr("scan.columns: 0")));
  EXPECT_THAT(refusal(layout_of(4, 100, 0, 0)),
              ThrowsMessage<std::invalid_argument>(HasSubstr("scan.windows: 0")));
  EXPECT_THAT(refusal(layout_of(4, 349, 50, 3)),
              ThrowsMessage<std::invalid_argument>(
                  AllOf(HasSubstr("scan.pixel_samples: 349"), HasSubstr("50 + 3 * 100"))));
}

TEST(PixelClock, LayoutTooLongFor64BitsIsRefused) {
  EXPECT_THROW(validate(layout_of(1, 1000, largest - 10), 100), std::invalid_argument);
  EXPECT_NO_THROW(validate(layout_of(1U << 31, 1U << 22), 100));
  EXPECT_THROW(validate(layout_of(1U << 31, (1U << 22) + 1), 100), std::invalid_argument);
  const std::uint64_t window = (std::uint64_t{1} << 32) - 1;
  const std::uint32_t windows = std::numeric_limits<std::uint32_t>::max();
  EXPECT_THROW(validate(layout_of(1, 1000, largest - 10, windows), window), std::invalid_argument);
}

TEST(PixelClock, PixelsTileTheLine) {
  std::mt19937_64 random(2);
  for (int i = 0; i < 300; ++i) {
    const auto columns = static_cast<std::uint32_t>(1 + random() % 700);
    const LineMark mark{.frame = 3,
                        .line = 17,
                        .direction = i % 2 == 0 ? Direction::trace : Direction::retrace,
                        .first_sample = random() % (std::uint64_t{1} << 50),
                        .line_samples = random() % (std::uint64_t{1} << (1 + random() % 45))};
    const ScanLayout layout = layout_of(columns, 0, 0, static_cast<std::uint32_t>(1 + random() % 3));
    const std::uint64_t window = 3 + random() % 1000;
    std::uint64_t next = mark.first_sample;
    for (std::uint32_t j = 0; j < columns; ++j) {
      const PixelSpan pixel = pixel_of_line(mark, layout, window, j);
      ASSERT_EQ(pixel.first_sample, next);
      ASSERT_EQ(pixel.end_sample, start_of(mark, columns, std::uint64_t{j} + 1));
      ASSERT_EQ(pixel.frame, 3U);
      ASSERT_EQ(pixel.line, 17U);
      ASSERT_EQ(pixel.direction, mark.direction);
      ASSERT_EQ(pixel.column, mark.direction == Direction::trace ? j : columns - 1 - j);
      next = pixel.end_sample;
    }
    ASSERT_EQ(next, mark.first_sample + mark.line_samples);
  }
}

TEST(PixelClock, ProductsBeyond64BitsDoNotOverflow) {
  const std::uint32_t columns = std::numeric_limits<std::uint32_t>::max();
  const LineMark mark{.first_sample = 5, .line_samples = (std::uint64_t{1} << 53) - 7};
  std::mt19937_64 random(3);
  for (int i = 0; i < 1000; ++i) {
    const auto j = static_cast<std::uint32_t>(i == 0 ? columns - 1 : random() % columns);
    const PixelSpan pixel = pixel_of_line(mark, layout_of(columns, 0), 3, j);
    ASSERT_EQ(pixel.first_sample, start_of(mark, columns, j));
    ASSERT_EQ(pixel.end_sample, start_of(mark, columns, std::uint64_t{j} + 1));
  }
}

TEST(PixelClock, TheLastWindowsOfThePixelAreAnalysed) {
  const LineMark mark{.first_sample = 1000, .line_samples = 1400};
  const PixelSpan pixel = pixel_of_line(mark, layout_of(4, 350, 50, 3), 100, 2);
  EXPECT_EQ(pixel.first_sample, 1700U);
  EXPECT_EQ(pixel.analysis_first, 1750U);
  EXPECT_EQ(pixel.end_sample, 2050U);
}

TEST(PixelClock, TooShortAPixelIsAnalysedFromItsStartAtTheEarliest) {
  const ScanLayout layout = layout_of(4, 350, 50, 3);
  const PixelSpan no_settling = pixel_of_line({.first_sample = 0, .line_samples = 1240}, layout, 100, 0);
  EXPECT_EQ(no_settling.analysis_first, 10U);
  EXPECT_LT(no_settling.analysis_first, no_settling.first_sample + layout.settle_samples);
  for (const std::uint64_t line_samples : {0U, 3U, 1000U, 1200U}) {
    const PixelSpan pixel = pixel_of_line({.first_sample = 7, .line_samples = line_samples}, layout, 100, 3);
    EXPECT_EQ(pixel.analysis_first, pixel.first_sample) << line_samples;
    EXPECT_LE(pixel.end_sample - pixel.first_sample, 300U) << line_samples;
  }
}

TEST(PixelClock, WithoutMarksPixelsFollowEachOther) {
  for (const std::uint64_t pixel_samples : {0U, 299U, 300U, 450U}) {
    const ScanLayout layout = layout_of(1, pixel_samples, 0, 3);
    const std::uint64_t length = pixel_samples > 300 ? pixel_samples : 300;
    for (std::uint32_t j = 0; j < 5; ++j) {
      const PixelSpan pixel = pixel_unmarked(77, layout, 100, j);
      EXPECT_EQ(pixel.first_sample, 77 + j * length);
      EXPECT_EQ(pixel.end_sample, pixel.first_sample + length);
      EXPECT_EQ(pixel.analysis_first, pixel.end_sample - 300);
      EXPECT_EQ(pixel.column, j);
      EXPECT_EQ(pixel.line, 0U);
      EXPECT_EQ(pixel.frame, 0U);
      EXPECT_EQ(pixel.direction, Direction::trace);
    }
  }
}

TEST(PixelClock, SettlingResidualDecaysFromTheStep) {
  const PixelSpan pixel{.first_sample = 1000, .end_sample = 2000, .analysis_first = 1400};
  EXPECT_DOUBLE_EQ(settling_residual(pixel, 1000, 100.0), std::exp(-4.0));
  EXPECT_DOUBLE_EQ(settling_residual(pixel, 0, 100.0), std::exp(-14.0));
  EXPECT_EQ(settling_residual(pixel, 1400, 100.0), 1.0);
  EXPECT_EQ(settling_residual(pixel, 1999, 100.0), 1.0) << "a step within the windows has not settled at all";
  EXPECT_EQ(settling_residual(pixel, 2000, 100.0), 0.0) << "a later step does not reach the pixel";
}

}  // namespace
}  // namespace combforce

#include "dsp/fourier.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

namespace combforce {
namespace {

TEST(Fourier, HoldsPeakPhasorsAndInverts) {
  constexpr std::size_t n = 240;
  std::vector<double> wave(n);
  for (std::size_t i = 0; i < n; ++i)
    wave[i] = 0.5 + 3.0 * std::cos(2.0 * std::numbers::pi * 7.0 * double(i) / n + 0.3) +
              (i % 2 == 0 ? 0.25 : -0.25);
  const std::vector<std::complex<double>> bins = spectrum_of(wave);
  ASSERT_EQ(bins.size(), n / 2 + 1);
  EXPECT_NEAR(std::abs(bins[0] - 0.5), 0.0, 1e-14);
  EXPECT_NEAR(std::abs(bins[7] - std::polar(3.0, 0.3)), 0.0, 1e-14);
  EXPECT_NEAR(std::abs(bins[n / 2] - 0.25), 0.0, 1e-14);
  EXPECT_THAT(signal_of(bins), testing::Pointwise(testing::DoubleNear(1e-13), wave));
}

}  // namespace
}  // namespace combforce

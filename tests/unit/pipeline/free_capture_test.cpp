#include "daemon/pipeline/free_capture.hpp"

#include <gtest/gtest.h>

#include <random>

namespace combforce {
namespace {

TEST(FreeCapture, GivesMeanAndCovarianceOfTheMean) {
  constexpr std::uint32_t windows = 7;
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  std::vector<std::vector<double>> rows;
  std::optional<FreeResponse> response;
  FreeCapture capture(windows, 2, [&](std::optional<FreeResponse> r, const std::string& why) {
    EXPECT_EQ(why, "");
    response = std::move(r);
  });
  for (std::uint32_t w = 0; w < windows; ++w) {
    rows.push_back({30.0 + normal(random), normal(random), 1e3 + normal(random), normal(random)});
    const std::vector<std::complex<double>> tones{{rows[w][0], rows[w][1]}, {rows[w][2], rows[w][3]}};
    EXPECT_EQ(capture.add(1000 + 50 * w, tones), w + 1 == windows);
  }
  capture.finish();
  ASSERT_TRUE(response.has_value());
  EXPECT_EQ(response->first_sample, 1000U);
  EXPECT_EQ(response->windows, windows);
  std::vector<double> mean(4);
  for (const auto& row : rows)
    for (std::size_t i = 0; i < 4; ++i) mean[i] += row[i] / windows;
  ASSERT_TRUE(response->covariance.has_value());
  // Two passes in double: rounding of values near 1e3 leaves 1e-12 of the O(1) scatter.
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(i % 2 == 0 ? response->mean_nm[i / 2].real() : response->mean_nm[i / 2].imag(), mean[i],
                1e-11);
    for (std::size_t j = 0; j < 4; ++j) {
      double sum = 0.0;
      for (const auto& row : rows) sum += (row[i] - mean[i]) * (row[j] - mean[j]);
      EXPECT_NEAR((*response->covariance)[4 * i + j], sum / (windows * (windows - 1.0)), 1e-11);
    }
  }
}

TEST(FreeCapture, SaysWhyThereIsNone) {
  std::string reason;
  FreeCapture capture(2, 1, [&](const std::optional<FreeResponse>& response, const std::string& why) {
    EXPECT_FALSE(response.has_value());
    reason = why;
  });
  capture.add(0, std::vector<std::complex<double>>{{1.0, 0.0}});
  capture.fail("samples were lost");
  capture.finish();
  EXPECT_EQ(reason, "samples were lost");
}

TEST(FreeCapture, OneWindowHasNoCovariance) {
  FreeCapture capture(1, 1, [](const std::optional<FreeResponse>& response, const std::string&) {
    ASSERT_TRUE(response.has_value());
    EXPECT_FALSE(response->covariance.has_value());
    EXPECT_EQ(response->mean_nm[0], std::complex<double>(1.5, -2.0));
  });
  EXPECT_TRUE(capture.add(0, std::vector<std::complex<double>>{{1.5, -2.0}}));
  capture.finish();
}

}  // namespace
}  // namespace combforce

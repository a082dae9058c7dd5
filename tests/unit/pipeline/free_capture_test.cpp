#include "daemon/pipeline/free_capture.hpp"

#include <gtest/gtest.h>

#include <numbers>
#include <random>

namespace combforce {
namespace {

constexpr double tolerance = 0.01;

Comb comb_of(std::size_t tones) {
  Comb comb{1000, {}};
  for (std::uint64_t bin = 1; bin <= tones; ++bin) comb.tones.push_back({10 * bin, true});
  return comb;
}

TEST(FreeCapture, GivesMeanAndCovarianceOfTheMean) {
  constexpr std::uint32_t windows = 7;
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  std::vector<std::vector<double>> rows;
  std::optional<FreeResponse> response;
  FreeCapture capture(windows, comb_of(2), 10.0, [&](std::optional<FreeResponse> r, const std::string& why) {
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
  FreeCapture capture(2, comb_of(1), tolerance,
                      [&](const std::optional<FreeResponse>& response, const std::string& why) {
                        EXPECT_FALSE(response.has_value());
                        reason = why;
                      });
  capture.add(0, std::vector<std::complex<double>>{{1.0, 0.0}});
  capture.fail("samples were lost");
  capture.finish();
  EXPECT_EQ(reason, "samples were lost");
}

TEST(FreeCapture, BegunAgainKnowsNothingOfBefore) {
  const std::vector<std::complex<double>> before{{100.0, -3.0}};
  const std::vector<std::vector<std::complex<double>>> after{
      {{1.0, 0.0}}, {{1.2, 0.1}}, {{0.9, 0.1}}, {{1.0, -0.1}}};
  const auto captured = [&](bool with_before) {
    std::optional<FreeResponse> result;
    FreeCapture capture(
        4, comb_of(1), tolerance,
        [&](std::optional<FreeResponse> response, const std::string&) { result = std::move(response); });
    if (with_before) {
      for (int i = 0; i < 3; ++i) EXPECT_FALSE(capture.add(0, before));
      capture.begin_again();
    }
    for (std::size_t i = 0; i < after.size(); ++i) EXPECT_EQ(capture.add(5000 + i, after[i]), i == 3);
    capture.finish();
    return result;
  };
  EXPECT_EQ(captured(true), captured(false));
}

TEST(FreeCapture, OneWindowHasNoCovariance) {
  FreeCapture capture(1, comb_of(1), tolerance,
                      [](const std::optional<FreeResponse>& response, const std::string&) {
                        ASSERT_TRUE(response.has_value());
                        EXPECT_FALSE(response->covariance.has_value());
                        EXPECT_EQ(response->mean_nm[0], std::complex<double>(1.5, -2.0));
                      });
  EXPECT_TRUE(capture.add(0, std::vector<std::complex<double>>{{1.5, -2.0}}));
  capture.finish();
}

// `windows` of two driven tones that turn by `turn_rad` from the first window to the last, the second ten
// times as fast, in noise of `noise` of their amplitude in each quadrature. Gives whether the capture calls
// itself coherent.
bool coherent(std::uint32_t windows, double turn_rad, double noise, std::uint32_t seed = 1) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0.0, noise);
  std::optional<bool> answer;
  FreeCapture capture(windows, comb_of(2), tolerance,
                      [&](const std::optional<FreeResponse>& response, const std::string& why) {
                        ASSERT_TRUE(response.has_value());
                        EXPECT_EQ(response->coherent, why.empty());
                        answer = response->coherent;
                      });
  for (std::uint32_t w = 0; w < windows; ++w) {
    const double turn = turn_rad * w / (windows - 1.0);
    const auto tone = [&](double turned) {
      return 20.0 * (std::polar(1.0, 0.7 + turned) + std::complex<double>(normal(random), normal(random)));
    };
    capture.add(std::uint64_t{1000} * w, std::vector<std::complex<double>>{tone(0.1 * turn), tone(turn)});
  }
  capture.finish();
  return answer.value();
}

TEST(FreeCapture, ATurnBeyondTheToleranceIsIncoherent) {
  EXPECT_TRUE(coherent(16, 0.0, 0.0));
  EXPECT_TRUE(coherent(16, 0.9 * tolerance, 0.0));
  EXPECT_FALSE(coherent(16, 1.1 * tolerance, 0.0));
  EXPECT_FALSE(coherent(16, -1.1 * tolerance, 0.0));
}

// Two and a half radians a window for 16 windows: the mean is nearly nothing, and the tone still turns.
TEST(FreeCapture, ManyTurnsAreIncoherent) {
  EXPECT_FALSE(coherent(16, 2.5 * 15, 0.01));
  EXPECT_FALSE(coherent(16, 2.0 * std::numbers::pi, 0.01));
}

// Phase noise of 1 % in every window is as large as the tolerance; a turn must exceed four deviations
// besides, and a tone in as much noise as signal says nothing. Of 500 draws of 16 windows a false alarm of a
// Student distribution of 14 degrees at four deviations would be one in 1500 a tone.
TEST(FreeCapture, NoiseIsNoDrift) {
  for (std::uint32_t seed = 1; seed <= 500; ++seed) {
    EXPECT_TRUE(coherent(16, 0.0, 0.01, seed)) << seed;
    EXPECT_TRUE(coherent(16, 0.0, 1.0, seed)) << seed;
  }
  EXPECT_FALSE(coherent(16, 0.2, 0.01));
}

TEST(FreeCapture, FewWindowsDoNotTellDriftFromNoise) {
  EXPECT_TRUE(coherent(3, 0.5, 0.0));
  EXPECT_FALSE(coherent(4, 0.5, 0.0));
}

FreeResponse response_of(std::complex<double> first, std::complex<double> second, double sigma_nm) {
  FreeResponse response{.first_sample = 77, .windows = 16, .mean_nm = {first, second}, .covariance = {}};
  response.covariance.emplace(16, 0.0);
  for (std::size_t i = 0; i < 4; ++i) (*response.covariance)[5 * i] = sigma_nm * sigma_nm;
  return response;
}

TEST(Drift, ReferencesAreComparedToneByTone) {
  Comb comb = comb_of(2);
  const FreeResponse before = response_of({20.0, 0.0}, {0.0, 1.0}, 0.0);
  const auto change = [&](std::complex<double> first, std::complex<double> second, double sigma = 0.0) {
    return find_change(comb, before, response_of(first, second, sigma), tolerance);
  };
  EXPECT_EQ(change({20.1, 0.1}, {0.009, 1.0}), "");
  EXPECT_NE(change({20.0, 0.0}, {0.02, 1.0}).find("bin 20"), std::string::npos);
  EXPECT_NE(change({19.7, 0.0}, {0.011, 1.0}).find("bin 10"), std::string::npos)
      << "the greater one is named";
  EXPECT_NE(change({19.7, 0.0}, {0.0, 1.0}).find("sample 77"), std::string::npos);
  EXPECT_EQ(change({20.0, 0.0}, {0.02, 1.0}, 0.01), "") << "noise of 10 pm explains 20 pm";
  comb.tones[1].driven = false;
  EXPECT_EQ(change({20.0, 0.0}, {0.5, 1.0}), "") << "what is not driven may do as it likes";
}

// Of the lifted mean, averaged over 4 windows where the free one has 16, noise is twice as great.
TEST(Drift, LiftedReferencesAreComparedToo) {
  const Comb comb = comb_of(2);
  const auto lifted = [](std::complex<double> second, double sigma) {
    FreeResponse response = response_of({20.0, 0.0}, {0.0, 1.0}, sigma);
    response.lifted_nm = {{15.0, 0.0}, second};
    response.lifted_windows = 4;
    return response;
  };
  const auto change = [&](std::complex<double> second, double sigma) {
    return find_change(comb, lifted({0.0, 0.8}, sigma), lifted(second, sigma), tolerance);
  };
  EXPECT_EQ(change({0.0, 0.8}, 0.0), "");
  const std::string turned = change(std::polar(0.8, 0.5 * std::numbers::pi + 0.4), 0.0);
  EXPECT_NE(turned.find("lifted response of the tone of bin 20"), std::string::npos) << turned;
  // 4 * 0.012 nm * 2 * 2 (quadratures, captures, windows) = 0.192 nm.
  EXPECT_EQ(change({0.15, 0.8}, 0.012), "");
  EXPECT_NE(change({0.25, 0.8}, 0.012), "");
  EXPECT_EQ(find_change(comb, response_of({20.0, 0.0}, {0.0, 1.0}, 0.0), lifted({0.5, 0.0}, 0.0), tolerance),
            "")
      << "nothing to compare";
}

TEST(Drift, ADrivenToneThatIsNoiseIsNamed) {
  Comb comb = comb_of(2);
  EXPECT_EQ(find_lost_tone(comb, response_of({20.0, 0.0}, {0.0, 1.0}, 0.1)), "");
  // One quadrature 0.4 nm is a standard deviation of 0.57 nm of both.
  EXPECT_EQ(find_lost_tone(comb, response_of({20.0, 0.0}, {0.0, 1.8}, 0.4)), "");
  EXPECT_NE(find_lost_tone(comb, response_of({20.0, 0.0}, {0.0, 1.6}, 0.4)).find("bin 20"),
            std::string::npos);
  EXPECT_NE(find_lost_tone(comb, response_of({0.1, 0.0}, {0.0, 1.6}, 0.4)).find("bin 10"), std::string::npos)
      << "the fainter one is named";
  comb.tones[1].driven = false;
  EXPECT_EQ(find_lost_tone(comb, response_of({20.0, 0.0}, {0.0, 0.1}, 0.4)), "");
  FreeResponse one_window = response_of({0.1, 0.0}, {0.1, 0.0}, 0.4);
  one_window.covariance.reset();
  EXPECT_EQ(find_lost_tone(comb, one_window), "") << "it cannot tell";
}

}  // namespace
}  // namespace combforce

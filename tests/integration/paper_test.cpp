// The parts of combforce paper that take no study: noise, statistics, spectra, the paper's own fit, rounding.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

#include "daemon/cli/paper/figures.hpp"
#include "daemon/cli/paper/grid_fit.hpp"
#include "daemon/cli/paper/remarks.hpp"

namespace combforce::paper {
namespace {

using Complex = std::complex<double>;

// 24.4, 3.4, 1.0, 0.4 pm (section 2.3): the noise of the draws as the paper prints it.
TEST(PaperNoise, HasThePrintedSpread) {
  CaseMotion motion{&find_case("dmt_4tone_equal_energy"), {}, {}};
  motion.engaged.tip_nm.assign(4, 0.0);
  std::array<double, 4> squares{};
  for (std::size_t draw = 0; draw < all_draws; ++draw) {
    const std::vector<Complex> tones = noisy_tones(motion, draw);
    EXPECT_EQ(tones, noisy_tones(motion, draw)) << "a draw repeats";
    for (std::size_t i = 0; i < 4; ++i) squares[i] += std::norm(tones[i]) / static_cast<double>(all_draws);
  }
  const std::array<double, 4> printed_pm{24.4, 3.4, 1.0, 0.4};
  // |noise|^2 is exponential of mean sigma^2: 100 draws give it to 10 %, sigma to 5 %; four times that, and
  // rounding.
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_NEAR(1e3 * std::sqrt(squares[i]), printed_pm[i], 0.2 * printed_pm[i] + 0.05) << "mode " << i + 1;
}

TEST(PaperScatter, IsThatOfAKnownSample) {
  const std::array<double, 5> values{4.0, 0.0, 1.0, 3.0, 2.0};
  const Scatter scatter = scatter_of(values);
  EXPECT_DOUBLE_EQ(scatter.mean, 2.0);
  EXPECT_DOUBLE_EQ(scatter.spread, std::sqrt(2.5));
  EXPECT_DOUBLE_EQ(scatter.kurtosis, 6.8 / 4.0);  // (16 + 1 + 0 + 1 + 16)/5 over 2^2
  EXPECT_DOUBLE_EQ(scatter.median, 2.0);
  EXPECT_DOUBLE_EQ(scatter.lower, 0.64);  // 0.16 of the way through the 4 steps
  EXPECT_DOUBLE_EQ(scatter.upper, 3.36);
  EXPECT_TRUE(std::isnan(scatter_of(std::span(values).first(1)).mean));
}

TEST(PaperDigits, DifferWhereTheRoundedNumberDoes) {
  EXPECT_FALSE(differs(-40.1215, -40.12));
  EXPECT_FALSE(differs(1.0449, 1.04));
  EXPECT_TRUE(differs(1.0451, 1.04));
  EXPECT_TRUE(differs(-40.1664, -40.14));
}

// A motion whose forces are those of the model on the grid: then E is 0 at the true parameters, whatever the
// grid.
TEST(PaperGridFit, RecoversParametersOfItsOwnForces) {
  CaseMotion motion{&find_case("hertz_2tone_equal_energy"), {}, {}};
  const std::array<Complex, 2> tip_nm{Complex(17.0, -31.6), Complex(1.9, -8.8)};
  const std::array<double, 2> truth{-40.0, 1.0};
  constexpr std::uint64_t samples = 200'000;  // bins 234 and 1348 are even: half the window is a period
  std::array<Complex, 2> force_nn{};
  for (std::uint64_t n = 0; n < samples; ++n) {
    std::array<Complex, 2> turn;
    double d = 0.0;
    for (std::size_t i = 0; i < 2; ++i) {
      turn[i] = std::polar(1.0, 2.0 * std::numbers::pi *
                                    static_cast<double>(motion.of->bins[i] * n % window_samples) /
                                    static_cast<double>(window_samples));
      d += (tip_nm[i] * turn[i]).real();
    }
    const double force = d < truth[0] ? truth[1] * std::pow(truth[0] - d, 1.5) : 0.0;
    for (std::size_t i = 0; i < 2; ++i) force_nn[i] += 2.0 / samples * force * std::conj(turn[i]);
  }
  for (std::size_t i = 0; i < 2; ++i)
    motion.free_nm.push_back(
        tip_nm[i] - force_nn[i] * tip_response(cantilever(), delta_f_hz * double(motion.of->bins[i])));
  const GridFit fit = GridProblem(motion, tip_nm).fit(std::array{-40.5, 0.8});
  EXPECT_TRUE(fit.converged);
  // E falls to 0, so the last step is of second order: well below the 1.5e-8 at which MINPACK stops.
  EXPECT_NEAR(fit.parameters[0], truth[0], 1e-6);
  EXPECT_NEAR(fit.parameters[1], truth[1], 1e-6);
}

TEST(PaperFigures, UnwritableDirectoryIsNamed) {
  EXPECT_THAT([] { draw("/nonexistent/figures", scripts()); },
              testing::ThrowsMessage<std::runtime_error>(testing::HasSubstr("/nonexistent/figures")));
}

}  // namespace
}  // namespace combforce::paper

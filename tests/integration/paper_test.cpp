// combforce paper, end to end: our simulator and fitter against an independent prototype's numbers, and the
// report.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>

#include "daemon/cli/paper/figures.hpp"
#include "daemon/cli/paper/fourier.hpp"
#include "daemon/cli/paper/remarks.hpp"
#include "daemon/cli/paper/report.hpp"
#include "daemon/cli/paper/scripts.hpp"

namespace combforce::paper {
namespace {

using Complex = std::complex<double>;

class PaperCase : public testing::TestWithParam<std::string_view> {
 protected:
  // As the prototype's report has it; skips when it is not there.
  Json prototype() {
    const std::string path = COMBFORCE_SHARED_DIR "/cases/paper_cases.json";
    if (!std::filesystem::exists(path)) return {};
    for (const Json& one : parse_json_file(path))
      if (one.at("name") == std::string(GetParam())) return one;
    return {};
  }
};

TEST_P(PaperCase, TonesAndNoiseFreeParametersAreThePrototypes) {
  const Json expected = prototype();
  if (expected.is_null()) GTEST_SKIP() << "no cases/paper_cases.json beside the project";
  const CaseMotion motion = simulate(find_case(GetParam()));
  for (std::size_t i = 0; i < motion.free_nm.size(); ++i) {
    const Json& tone = expected.at("engaged_nm").at(i);
    // Required of the accurate setting: 0.05 pm.
    EXPECT_LT(std::abs(motion.engaged.tip_nm[i] - Complex(tone.at(0), tone.at(1))), 5e-5) << "tone " << i;
  }
  FitResult fit;
  PixelFitter(fit_conditions(motion)).fit(motion.engaged.tip_nm, fit);
  ASSERT_TRUE(has_parameters(fit));
  // Required: 0.001 nm and 0.05 %. Equal amplitude makes the DMT fit 6 to 10 times as sensitive: 0.005 nm and
  // 0.3 %.
  const bool sensitive = GetParam() == "dmt_4tone_equal_amplitude";
  for (std::size_t k = 0; k < motion.of->truth.size(); ++k) {
    const double value = expected.at("partial_fit").at(k);
    const double bound = k == 0 ? (sensitive ? 0.005 : 0.001) : (sensitive ? 3e-3 : 5e-4) * value;
    EXPECT_NEAR(fit.parameters[k], value, bound) << "p" << k;
  }
}

INSTANTIATE_TEST_SUITE_P(AllOfThePaper, PaperCase,
                         testing::Values("hertz_2tone_equal_energy", "hertz_2tone_equal_amplitude",
                                         "hertz_4tone_equal_energy", "dmt_4tone_equal_energy",
                                         "dmt_4tone_equal_amplitude"),
                         [](const auto& one) { return std::string(one.param); });

// Without the prototype's numbers too: the paper's own, in its digits.
TEST(PaperTables, HertzWithoutNoiseIsAsPrinted) {
  for (const std::string_view key :
       {"hertz_2tone_equal_energy", "hertz_2tone_equal_amplitude", "hertz_4tone_equal_energy"}) {
    const CaseMotion motion = simulate(find_case(key));
    FitResult fit;
    PixelFitter(fit_conditions(motion)).fit(motion.engaged.tip_nm, fit);
    for (std::size_t k = 0; k < 2; ++k)
      EXPECT_FALSE(differs(fit.parameters[k], motion.of->printed.noise_free[k])) << key << " p" << k;
  }
}

// 24.4, 3.4, 1.0, 0.4 pm (section 2.3): the noise of the draws as the paper prints it.
TEST(PaperNoise, HasThePrintedSpread) {
  CaseMotion motion{&find_case("dmt_4tone_equal_energy"), {}, {}};
  motion.engaged.tip_nm.assign(4, 0.0);
  std::array<double, 4> squares{};
  for (std::size_t draw = 0; draw < draws; ++draw) {
    const std::vector<Complex> tones = noisy_tones(motion, draw);
    EXPECT_EQ(tones, noisy_tones(motion, draw)) << "a draw repeats";
    for (std::size_t i = 0; i < 4; ++i) squares[i] += std::norm(tones[i]) / static_cast<double>(draws);
  }
  const std::array<double, 4> printed_pm{24.4, 3.4, 1.0, 0.4};
  // |noise|^2 is exponential of mean sigma^2: 100 draws give it to 10 %, sigma to 5 %; four times that, and
  // rounding.
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_NEAR(1e3 * std::sqrt(squares[i]), printed_pm[i], 0.2 * printed_pm[i] + 0.05) << "mode " << i + 1;
}

TEST(PaperSpectrum, HoldsPeakPhasorsAndInverts) {
  constexpr std::size_t n = 240;
  std::vector<double> wave(n);
  for (std::size_t i = 0; i < n; ++i)
    wave[i] = 0.5 + 3.0 * std::cos(2.0 * std::numbers::pi * 7.0 * double(i) / n + 0.3) +
              (i % 2 == 0 ? 0.25 : -0.25);
  const std::vector<Complex> bins = spectrum(wave);
  ASSERT_EQ(bins.size(), n / 2 + 1);
  EXPECT_NEAR(std::abs(bins[0] - 0.5), 0.0, 1e-14);
  EXPECT_NEAR(std::abs(bins[7] - std::polar(3.0, 0.3)), 0.0, 1e-14);
  EXPECT_NEAR(std::abs(bins[n / 2] - 0.25), 0.0, 1e-14);
  EXPECT_THAT(signal(bins), testing::Pointwise(testing::DoubleNear(1e-13), wave));
}

// The whole command, once.
class PaperReport : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    results() = reproduce([](std::string_view) {});
  }
  static Results& results() {
    static Results all;
    return all;
  }
};

// The paper: at most 800 pN, standard deviation 10 pN. Its figure shows DMT; a Hertz force has
// no kink of its slope and must do far better.
TEST_F(PaperReport, SimulatorIsAsAccurateAsThePapers) {
  for (const SimulatorCheck& check : results().checks) {
    if (check.of->scheme == DriveScheme::equal_amplitude && check.of->model == "dmt")
      continue;  // twice the speed
    EXPECT_LE(check.largest_nn, check.of->model == "dmt" ? 0.8 : 0.1) << check.of->key;
    EXPECT_LE(check.spread_nn, check.of->model == "dmt" ? 0.010 : 0.001) << check.of->key;
  }
  // What is left is the spectrum's end, not the integrator: a kink's error falls with the rate.
  EXPECT_LT(results().check_at_double_rate.spread_nn, 0.6 * results().checks[3].spread_nn);
}

TEST_F(PaperReport, HertzScatterIsThePapers) {
  for (const TableRow& row : results().rows) {
    if (row.of->model != "hertz") continue;
    EXPECT_EQ(row.valid, draws) << row.of->key;
    for (std::size_t k = 0; k < 2; ++k) {
      const double printed = row.of->printed.spread[k];
      // Two standard deviations of 100 draws each: 10 % of their difference, twice that for the skew ones;
      // four times.
      EXPECT_NEAR(row.scatter[k].spread, printed, 0.4 * printed + 0.005) << row.of->key << " p" << k;
      EXPECT_NEAR(row.scatter[k].mean, row.of->printed.mean[k],
                  4.0 * printed * std::sqrt(2.0 / draws) + 0.005);
    }
  }
}

TEST_F(PaperReport, StartsFailOnlyFarFromTheSurface) {
  ASSERT_EQ(results().maps.size(), 2U);
  for (const ErrorMap& map : results().maps) {
    // The paper: only when p0 is several nm away. The motion reaches -45 nm: below, a start feels no force.
    EXPECT_LE(map.first_p0_nm, -43.0) << map.of->key;
    EXPECT_GE(map.last_p0_nm, -37.0) << map.of->key;
    EXPECT_LT(map.found_share, 1.0) << map.of->key;
  }
}

TEST_F(PaperReport, HertzCurvesLieWithin1NanonewtonOfTheTruth) {
  const ForceCurves& hertz = results().curves.at(0);
  EXPECT_EQ(hertz.fitted_nn.size(), draws);
  EXPECT_LT(hertz.median_largest_nn, 1.0);  // "typically"
}

TEST_F(PaperReport, MarkdownHasEveryRow) {
  const std::string text = markdown(results());
  for (const Case& one : cases())
    EXPECT_THAT(text,
                testing::HasSubstr(fmt::format("| {} | {:.2f} |", one.label, one.printed.noise_free[0])));
  for (const char* title :
       {"## Hertz", "## DMT", "## Error map", "## Force curves", "## The simulator", "## Motion"})
    EXPECT_THAT(text, testing::HasSubstr(title));
  for (std::size_t i = 0; i < results().rows.size(); ++i)
    for (const std::string& remark : results().remarks[i]) EXPECT_THAT(text, testing::HasSubstr(remark));
}

TEST_F(PaperReport, EveryDifferentDigitHasARemark) {
  for (std::size_t i = 0; i < results().rows.size(); ++i) {
    const TableRow& row = results().rows[i];
    bool different = false;
    for (std::size_t k = 0; k < row.of->truth.size(); ++k)
      different |= differs(row.noise_free.parameters[k], row.of->printed.noise_free[k]) ||
                   differs(row.scatter[k].mean, row.of->printed.mean[k]) ||
                   differs(row.scatter[k].spread, row.of->printed.spread[k]);
    EXPECT_EQ(different, !results().remarks[i].empty()) << row.of->key;
  }
}

TEST_F(PaperReport, JsonIsStrictAndComplete) {
  const Json read = parse_json(json(results()).dump(), "paper.json");
  ASSERT_EQ(read.at("tables").size(), cases().size());
  for (std::size_t i = 0; i < cases().size(); ++i) {
    const Json& ours = read.at("tables").at(i).at("ours");
    EXPECT_EQ(read.at("tables").at(i).at("case"), std::string(cases()[i].key));
    for (const char* part : {"noise_free", "mean", "standard_deviation"}) {
      ASSERT_EQ(ours.at(part).size(), cases()[i].truth.size());
      for (const auto& [parameter, value] : ours.at(part).items())
        EXPECT_TRUE(value.is_number()) << part << parameter;
    }
  }
  EXPECT_EQ(read.at("simulator_check").size(), cases().size());
  EXPECT_EQ(read.at("error_maps").size(), 2U);
  EXPECT_EQ(read.at("motion").at("mode_nm").size(), 4U);
}

TEST_F(PaperReport, DataFilesNameTheirColumnsAndFiguresAreDrawn) {
  const std::filesystem::path directory =
      std::filesystem::path(testing::TempDir()) / "combforce_paper_figures";
  std::filesystem::remove_all(directory);
  std::filesystem::create_directories(directory);
  write_data(directory, results());
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(directory)) {
    std::ifstream file(entry.path());
    EXPECT_EQ(file.get(), '#') << entry.path();
    ++files;
  }
  EXPECT_EQ(files, 2U + 5U + 2U + 1U + 2U);
  if (draw(directory) == Drawing::no_gnuplot) GTEST_SKIP() << "gnuplot is not installed";
  for (const Script& script : scripts()) {
    const auto figure = directory / script.name;
    const bool drawn = std::filesystem::exists(figure.string() + ".svg") ||
                       std::filesystem::exists(figure.string() + ".png");
    EXPECT_TRUE(drawn) << script.name;
  }
  std::filesystem::remove_all(directory);
}

TEST(PaperFigures, UnwritableDirectoryIsNamed) {
  EXPECT_THAT([] { draw("/nonexistent/figures"); },
              testing::ThrowsMessage<std::runtime_error>(testing::HasSubstr("/nonexistent/figures")));
}

}  // namespace
}  // namespace combforce::paper

// Error bars of the refined fit against Langevin forces in the time domain.
#include <gtest/gtest.h>

#include <algorithm>

#include "daemon/cli/paper/coverage.hpp"

namespace combforce::paper {
namespace {

const CoverageCase& find(std::string_view key) {
  return *std::ranges::find(coverage_cases(), key, &CoverageCase::key);
}

double share(const Coverage& coverage, FitStatus status) {
  return static_cast<double>(coverage.statuses[static_cast<std::size_t>(status)]) /
         static_cast<double>(coverage.pixels);
}

// Shares of 2000 pixels are known to 1.0 % (68 %) and 0.5 % (95 %): both bounds lie at five times that.
void expect_covered(const Coverage& coverage) {
  EXPECT_GT(coverage.fitted, coverage.pixels * 99 / 100);
  for (std::size_t k = 0; k < coverage.parameters.size(); ++k) {
    const ParameterCoverage& parameter = coverage.parameters[k];
    EXPECT_NEAR(parameter.within_68, 0.68, 0.05) << coverage.of->label << ", parameter " << k;
    EXPECT_NEAR(parameter.within_95, 0.95, 0.025) << coverage.of->label << ", parameter " << k;
  }
}

class Efficient : public testing::TestWithParam<const char*> {};

// Neither wider nor narrower than the noise, and no wider than it must be.
TEST_P(Efficient, IntervalsCoverAndScatterIsNearItsBound) {
  const CoverageCase& of = find(GetParam());
  const Coverage coverage = measure_coverage(of, of.pixels);
  expect_covered(coverage);
  for (const ParameterCoverage& parameter : coverage.parameters)
    EXPECT_LT(parameter.scatter, 1.1 * parameter.bound) << coverage.of->label;
}

INSTANTIATE_TEST_SUITE_P(Coverage, Efficient,
                         testing::Values("hertz_2tone_equal_energy", "hertz_4tone_equal_energy",
                                         "dmt_4tone_equal_energy"));

// They are those that `combforce drive design` adds, which leave .24 .15 .24 .45 of the errors.
TEST(Coverage, SidebandsSharpenAndTheIntervalsCover) {
  const CoverageCase &with = find("dmt_4tone_equal_energy_sidebands"),
                     &without = find("dmt_4tone_equal_energy");
  const Coverage coverage = measure_coverage(with, with.pixels);
  expect_covered(coverage);
  const Coverage wide = measure_coverage(without, 100);  // the median of its errors is known to a few percent
  for (std::size_t k = 0; k < coverage.parameters.size(); ++k)
    EXPECT_LT(coverage.parameters[k].claimed, 0.5 * wide.parameters[k].claimed) << "parameter " << k;
}

TEST(Coverage, MeansOfSixteenWindowsCoverAtEqualAmplitude) {
  const CoverageCase& of = find("hertz_2tone_equal_amplitude_16");
  expect_covered(measure_coverage(of, of.pixels));
}

TEST(Coverage, OneWindowOfDmtAtEqualAmplitudeSaysThatItDoesNotTellTheParameters) {
  const CoverageCase& of = find("dmt_4tone_equal_amplitude");
  const Coverage coverage = measure_coverage(of, of.pixels);
  EXPECT_GE(share(coverage, FitStatus::ill_conditioned), 0.95);
}

}  // namespace
}  // namespace combforce::paper

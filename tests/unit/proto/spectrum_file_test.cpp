#include "proto/spectrum_file.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "tests/unit/proto/input_error.hpp"

namespace combforce {
namespace {

using testing::HasSubstr;

std::string rows(int count, const std::string& separator = " ") {
  std::string text;
  for (int i = 0; i < count; ++i) text += fmt::format("{1}{0}1e-9{0}{2}\n", separator, 2.5 * i + 10.0, i);
  return text;
}

TEST(SpectrumFile, ReadsColumnsOfText) {
  for (const char* separator : {" ", "\t", ", ", ";"}) {
    const SpectrumFile file = parse_spectrum("# f  S\n\n" + rows(20, separator) + "\r\n", "s.txt");
    EXPECT_EQ(file.first_hz, 10.0);
    EXPECT_NEAR(file.bin_hz, 2.5, 1e-12);
    EXPECT_EQ(file.density, std::vector<double>(20, 1e-9));
    EXPECT_FALSE(file.vendor);
  }
  EXPECT_EQ(parse_spectrum(rows(20), "s.txt", 3).density[7], 7.0);
}

const std::string header =
    "# thermal noise data\n# sensitivity: 11.0399 nm/V\n# spring constant: 45.8785 mN/m\n# fit parameter:\n"
    "# parameter.f: 24.25 kHz\n# parameter.Q: 2.050\n# parameter.A: 92.12 µV/√Hz\n"
    "# parameter.noise: 4.501×10⁻¹⁰ V²/Hz\n# settings.temperature: 25.0 ℃\n"
    "# cantilever.correction factor: 0.9000\n# Channels: 'Frequency'\n";

TEST(SpectrumFile, ReadsAVendorsHeader) {
  const auto vendor = parse_spectrum(header + rows(16), "s.tnd").vendor;
  ASSERT_TRUE(vendor);
  EXPECT_NEAR(vendor->sensitivity_nm_per_v.value(), 11.0399, 1e-12);
  EXPECT_NEAR(vendor->stiffness_n_per_m.value(), 45.8785e-3, 1e-15);
  EXPECT_NEAR(vendor->frequency_hz.value(), 24250.0, 1e-9);
  EXPECT_EQ(vendor->quality_factor, 2.05);
  EXPECT_NEAR(vendor->amplitude_v_per_sqrt_hz.value(), 92.12e-6, 1e-15);
  EXPECT_NEAR(vendor->floor_v2_per_hz.value(), 4.501e-10, 1e-20);
  EXPECT_NEAR(vendor->temperature_k.value(), 298.15, 1e-9);
  EXPECT_EQ(vendor->correction_factor, 0.9);
  EXPECT_FALSE(parse_spectrum("# thermal noise data\n" + rows(16), "s.tnd").vendor->frequency_hz);
}

TEST(SpectrumFile, SaysWhichLineIsWrong) {
  struct Case {
    std::string text, place;
    const char* said;
  };
  const std::string good = rows(20);
  const Case cases[] = {
      {"", "", "has 0 rows of numbers, must have at least 16"},
      {rows(15), "", "has 15 rows"},
      {"#\n" + good + "60 abc 1\n", "line 22", "column 2 is \"abc\", must be a number"},
      {good + "60\n", "line 21", "has 1 columns, must have at least 2"},
      {good + "60 -1e-9 0\n", "line 21", "column 2 is -1e-09, must be >= 0 and finite"},
      {good + "60 nan 0\n", "line 21", "column 2 is nan"},
      {good + "60 inf 0\n", "line 21", "column 2 is inf"},
      {good + "60 1 0\n60 1 0\n", "line 22", "frequency 60 Hz, must be 62.5 Hz"},
      {good + "-60 1 0\n", "line 21", "column 1 is -60"},
      {good + "61 1 0\n", "line 21", "frequency 61 Hz, must be 60 Hz: in equal steps"},
      {good + good, "line 21", "in equal steps"},
      {"# thermal noise data\n# parameter.f: 24 furlongs\n" + good, "line 2",
       "\"24 furlongs\", must be a number with unit \"kHz\" or \"Hz\" or \"MHz\""},
      {"# thermal noise data\n# parameter.Q: two\n" + good, "line 2", "\"two\""},
  };
  for (const Case& bad : cases) {
    const auto error = refusal([&] { parse_spectrum(bad.text, "s.txt"); });
    EXPECT_EQ(error.file(), "s.txt");
    EXPECT_THAT(error.pointer(), HasSubstr(bad.place)) << bad.said;
    EXPECT_THAT(error.message(), HasSubstr(bad.said));
  }
  EXPECT_THAT(refusal([] { read_spectrum_file("/nowhere/s.txt"); }).what(), HasSubstr("/nowhere/s.txt"));
  EXPECT_THROW(parse_spectrum(good, "s.txt", 1), std::invalid_argument);
}

TEST(SpectrumFile, ReadsAMeasuredOne) {
  const std::string path = COMBFORCE_SHARED_DIR "/data/jpk_water_thermal.tnd";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is not there";
  const SpectrumFile file = read_spectrum_file(path);
  EXPECT_EQ(file.density.size(), 31131U);
  EXPECT_EQ(file.first_hz, 0.0);
  EXPECT_NEAR(file.bin_hz, 12.20703125, 1e-9);
  EXPECT_EQ(file.vendor->frequency_hz, 24250.0);
}

}  // namespace
}  // namespace combforce

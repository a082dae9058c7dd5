#include "proto/calibration.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/proto/input_error.hpp"

namespace combforce {
namespace {

using testing::HasSubstr;

Calibration example() {
  Calibration calibration;
  calibration.cantilever.modes = {{50e3, 100.0, 2.5, 40.0}, {313e3, 300.0, 98.0, -11.0}};
  calibration.noise = {295.0, {2e-4}};
  Eigen::Matrix4d roots;
  roots << 1e-4, 0, 0, 0, 2e-3, 2e-2, 0, 0, -1e-3, 1e-2, 1e-2, 0, 5e-4, -3e-3, 0, 4e-3;
  for (const double share : {1.0, 4.0})
    calibration.cantilever.uncertainty.push_back(uncertainty_of(
        calibration.cantilever.modes[share == 1.0 ? 0 : 1], share * roots * roots.transpose()));
  calibration.origin = {{"method", "sader"}};
  return calibration;
}

TEST(CalibrationFile, IsReadAsWritten) {
  const Calibration written = example();
  const Calibration read = parse_calibration(encode(written).dump(), "c.json");
  EXPECT_EQ(read.cantilever, written.cantilever);
  EXPECT_EQ(read.noise, written.noise);
  EXPECT_EQ(read.origin, written.origin);
  EXPECT_EQ(read.cantilever.uncertainty.size(), 2U);
}

TEST(CalibrationFile, StatesErrorsInTheUnitsOfTheMode) {
  const Json errors = encode(example())["cantilever"]["uncertainty"][0]["std_errors"];
  EXPECT_NEAR(errors["frequency_hz"].get<double>(), 5.0, 1e-9);
  EXPECT_NEAR(errors["stiffness_n_per_m"].get<double>(), 2.5 * std::sqrt(2.01e-4), 1e-9);
}

TEST(CalibrationFile, SaysNullOfWhatIsNotKnown) {
  Calibration unknown = example();
  unknown.cantilever.uncertainty[0].std_errors.fill(std::nan(""));
  unknown.cantilever.uncertainty[0].correlation.fill(std::nan(""));
  const Json encoded = encode(unknown);
  EXPECT_TRUE(encoded["cantilever"]["uncertainty"][0]["std_errors"]["frequency_hz"].is_null());
  EXPECT_TRUE(encoded["cantilever"]["uncertainty"][0]["correlation"][5].is_null());
  EXPECT_EQ(parse_calibration(encoded.dump(), "c.json").cantilever, unknown.cantilever);
  EXPECT_TRUE(parse_calibration(R"({"cantilever": {"modes": [{"frequency_hz": 1, "quality_factor": 1,
      "stiffness_n_per_m": 1}]}, "noise": {"temperature_k": 1, "detector_nm_per_sqrt_hz": 0}})",
                                "c.json")
                  .cantilever.uncertainty.empty());
}

TEST(CalibrationFile, RefusesWhatItIsNot) {
  const Json good = encode(example());
  struct Case {
    const char* pointer;
    Json value;
    const char* said;
  };
  const Case cases[] = {
      {"/cantilever/modes/1/quality_factor", -3.5, "is -3.5, must be > 0"},
      {"/noise/temperature_k", -1, "is -1, must be >= 0"},
      {"/cantilever/uncertainty", Json::array(), "has 0 elements, must have 2"},
      {"/cantilever/uncertainty/1/std_errors/frequency_hz", -2, "is -2, must be >= 0"},
      {"/cantilever/uncertainty/1/std_errors/frequency", 2, "unknown key"},
      {"/cantilever/uncertainty/0/correlation", Json::array({0, 0}), "has 2 elements, must have 6"},
      {"/cantilever/uncertainty/0/correlation/3", 1.5, "is 1.5, must be in [-1, 1]"},
      {"/origin", 3, "must be an object"},
      {"/thermal", 3, "unknown key"},
  };
  for (const Case& bad : cases) {
    Json changed = good;
    changed[Json::json_pointer(bad.pointer)] = bad.value;
    const auto error = refusal([&] { parse_calibration(changed.dump(), "c.json"); });
    EXPECT_EQ(error.file(), "c.json");
    EXPECT_EQ(error.pointer(), bad.pointer);
    EXPECT_THAT(error.message(), HasSubstr(bad.said));
  }
  EXPECT_EQ(refusal([] { parse_calibration("{}", "c.json"); }).pointer(), "/cantilever");
}

}  // namespace
}  // namespace combforce

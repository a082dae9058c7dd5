#include "proto/description.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/proto/input_error.hpp"

namespace combforce {
namespace {

using testing::HasSubstr;

const std::string file = "rec";

// All objects with every key of the recording contract.
constexpr auto complete = R"({
  "afm:channels": [
    {"name": "deflection", "role": "deflection", "unit": "V", "scale": 1e-4, "offset": 0.5, "nm_per_v": 80, "clip_codes": [-32768, 32767]},
    {"name": "z", "role": "z", "unit": "nm", "scale": 0.01, "offset": 0.0}],
  "afm:cantilever": {"modes": [
    {"frequency_hz": 117000.0, "quality_factor": 212.0, "stiffness_n_per_m": 4.0, "sensitivity_nm_per_v": 20.0},
    {"frequency_hz": 674000.0, "quality_factor": 457.0, "stiffness_n_per_m": 78.5, "sensitivity_nm_per_v": -7.0}],
    "uncertainty": [
      {"std_errors": {"frequency_hz": 1.5, "quality_factor": 3.0, "stiffness_n_per_m": 0.25, "sensitivity_nm_per_v": 0.5},
       "correlation": [0, 0, 0.5, -0.5, 0, -0.9]},
      {"std_errors": {"frequency_hz": 9.0, "quality_factor": 5.0, "stiffness_n_per_m": null, "sensitivity_nm_per_v": null},
       "correlation": [0, null, null, null, null, null]}]},
  "afm:excitation": {"kind": "base", "participation": [1.5, -0.75]},
  "afm:comb": {"window_samples": 8000, "tones": [{"bin": 117, "driven": true}, {"bin": 674, "driven": false}]},
  "afm:free_response": {"first_sample": 16000, "windows": 2, "mean_nm": [[0.0, -25.0], [1.5, -2.5]],
    "covariance": [[1, 0, 0, 0], [0, 2, 0, 0], [0, 0, 3, 0.5], [0, 0, 0.5, 4]], "coherent": false,
    "lifted_nm": [[0.5, -24.0], [1.5, -2.25]], "lifted_windows": 3},
  "afm:scan": {"lines": 64, "columns": 32, "pixel_samples": 16000, "settle_samples": 8000, "windows": 1,
    "bidirectional": true, "size_nm": [1000.0, 500.0]},
  "afm:noise": {"temperature_k": 300.0, "detector_nm_per_sqrt_hz": [1e-4, 2e-4]},
  "afm:fit": {"model": "dmt", "refine": 2, "weighting": "noise", "profile_intervals": true, "calibration_errors": true,
    "background": "linear", "compare": ["hertz", "cone"], "bounds": {"adhesion_nn": [0.0, 20.0]}}
})";

template <typename Decode>
InputError decode_refusal(Decode decode, const std::string& text) {
  const Json json = parse_json(text, file);
  return refusal([&] { decode(JsonView(json, file), UnknownKeys::refuse); });
}

template <typename Decode>
auto decoded(Decode decode, const std::string& text) {
  const Json json = parse_json(text, file);
  return decode(JsonView(json, file), UnknownKeys::refuse);
}

TEST(Description, DecodesEveryKeyOfTheContract) {
  const Json json = parse_json(complete, file);
  const Description description = decode_description(JsonView(json, file), "afm:");
  const Channel deflection{"deflection", ChannelRole::deflection,           "V", 1e-4,
                           0.5,          Channel::ClipCodes{-32768, 32767}, 80.0};
  const Channel z{"z", ChannelRole::z, "nm", 0.01, 0.0, std::nullopt};
  EXPECT_EQ(description.channels, (Channels{deflection, z}));
  const double nan = std::nan("");
  EXPECT_EQ(description.cantilever, (Cantilever{{{117e3, 212, 4, 20}, {674e3, 457, 78.5, -7}},
                                                {{{1.5, 3, 0.25, 0.5}, {0, 0, 0.5, -0.5, 0, -0.9}},
                                                 {{9, 5, nan, nan}, {0, nan, nan, nan, nan, nan}}}}));
  EXPECT_EQ(description.excitation, (Excitation{Excitation::Kind::base, {1.5, -0.75}}));
  EXPECT_EQ(description.comb, (Comb{8000, {{117, true}, {674, false}}}));
  EXPECT_EQ(description.free_response,
            (FreeResponse{16000,
                          2,
                          {{0, -25}, {1.5, -2.5}},
                          std::vector<double>{1, 0, 0, 0, 0, 2, 0, 0, 0, 0, 3, 0.5, 0, 0, 0.5, 4},
                          false,
                          std::vector<std::complex<double>>{{0.5, -24}, {1.5, -2.25}},
                          3}));
  EXPECT_EQ(description.scan, (ScanLayout{64, 32, 16000, 8000, 1, true, {1000, 500}}));
  EXPECT_EQ(description.noise, (Noise{300, {1e-4, 2e-4}}));
  FitSettings fit{"dmt", 2, Weighting::noise, true, {{"adhesion_nn", 0, 20}}};
  fit.calibration_errors = true;
  fit.background = Background::linear;
  fit.compare = {"hertz", "cone"};
  EXPECT_EQ(description.fit, fit);
}

TEST(Description, EncodesWhatItDecodes) {
  const Json json = parse_json(complete, file);
  const Description description = decode_description(JsonView(json, file), "afm:");
  Json encoded = Json::object();
  encode_into(encoded, description, "afm:");
  EXPECT_EQ(encoded, json);  // 1 and 1.0 are equal numbers
  EXPECT_EQ(decode_description(JsonView(encoded, file), "afm:"), description);
}

TEST(Description, LeavesAbsentObjectsAndForeignKeysAlone) {
  const Json json = parse_json(R"({"core:version": "1.2.5", "comb": 3})", file);
  EXPECT_EQ(decode_description(JsonView(json, file), "afm:"), Description{});
  Json object{{"kept", 1}};
  encode_into(object, Description{}, "afm:");
  EXPECT_EQ(object, (Json{{"kept", 1}}));
}

TEST(Description, OverlayTakesTheTopWhereItSaysSomething) {
  Description base, top;
  base.comb = Comb{100, {{7, true}}};
  base.noise = Noise{300, {0.0}};
  top.noise = Noise{4, {1.0}};
  const Description merged = overlay(base, top);
  EXPECT_EQ(merged.comb, base.comb);
  EXPECT_EQ(merged.noise, top.noise);
  EXPECT_FALSE(merged.scan);
}

TEST(Description, FillsInDefaults) {
  EXPECT_EQ(decoded(decode_channels, R"([{"name": "d", "role": "deflection"}])"),
            (Channels{{"d", ChannelRole::deflection, "V", 1.0, 0.0, std::nullopt}}));
  EXPECT_EQ(decoded(decode_scan, R"({"lines": 2, "columns": 3, "pixel_samples": 4})"),
            (ScanLayout{2, 3, 4, 0, 1, false, {0, 0}}));
  EXPECT_EQ(decoded(decode_comb, R"({"window_samples": 8, "tones": [{"bin": 3}]})"), (Comb{8, {{3, true}}}));
  EXPECT_EQ(decoded(decode_fit, "{}"), FitSettings{});
  EXPECT_EQ(decoded(decode_drive, "{}"), Drive{});
}

TEST(Description, TakesABareFreeResponse) {
  EXPECT_EQ(decoded(decode_free_response, "[[1, 2], [3, -4]]"),
            (FreeResponse{0, 0, {{1, 2}, {3, -4}}, std::nullopt}));
}

TEST(Description, TakesNoiseAsOneNumberOrAsMany) {
  EXPECT_EQ(decoded(decode_noise, R"({"temperature_k": 0, "detector_nm_per_sqrt_hz": 2})"), (Noise{0, {2}}));
  EXPECT_EQ(encode(Noise{0, {2}})["detector_nm_per_sqrt_hz"], Json(2.0));
}

TEST(Description, KeepsDrivesThroughJson) {
  const Drive listed{DriveScheme::amplitudes, 50.0, {30, 20}, {0, 1.5}};
  const Drive total{DriveScheme::equal_amplitude, 20.0, {}, {}};
  for (const auto& drive : {listed, total}) {
    const Json json = encode(drive);
    EXPECT_EQ(decode_drive(JsonView(json, file)), drive) << json;
  }
}

TEST(Description, RefusesUnknownKeysUnlessToldNotTo) {
  const Json json =
      parse_json(R"({"window_samples": 8, "tones": [{"bin": 3, "colour": "red"}], "x": 1})", file);
  EXPECT_EQ(refusal([&] { decode_comb(JsonView(json, file)); }).pointer(), "/x");
  EXPECT_EQ(decode_comb(JsonView(json, file), UnknownKeys::allow), (Comb{8, {{3, true}}}));
}

struct Refused {
  const char* text;
  const char* pointer;
  const char* message;
};

template <typename Decode>
void expect_refused(Decode decode, const std::vector<Refused>& cases) {
  for (const auto& [text, pointer, message] : cases) {
    const auto error = decode_refusal(decode, text);
    EXPECT_EQ(error.pointer(), pointer) << text;
    EXPECT_THAT(error.message(), HasSubstr(message)) << text;
    EXPECT_EQ(error.file(), file);
  }
}

TEST(Description, RefusesBadChannels) {
  expect_refused(
      decode_channels,
      {{"[]", "", "is empty"},
       {"{}", "", "must be an array"},
       {R"([{"role": "deflection"}])", "/0/name", "is missing"},
       {R"([{"name": "", "role": "deflection"}])", "/0/name", "is empty"},
       {R"([{"name": "d"}])", "/0/role", "is missing"},
       {R"([{"name": "d", "role": "x"}])", "/0/role", "must be one of"},
       {R"([{"name": "z", "role": "z"}])", "/0/role", R"(must be "deflection")"},
       {R"([{"name": "d", "role": "deflection", "unit": "A"}])", "/0/unit", R"(must be one of "V", "nm")"},
       {R"([{"name": "d", "role": "deflection", "scale": 0}])", "/0/scale", "must not be 0"},
       {R"([{"name": "d", "role": "deflection", "nm_per_v": 0}])", "/0/nm_per_v", "must not be 0"},
       {R"([{"name": "d", "role": "deflection"}, {"name": "z", "role": "z", "nm_per_v": 2}])", "/1/nm_per_v",
        "belongs to the deflection"},
       {R"([{"name": "d", "role": "deflection", "clip_codes": [3, 3]}])", "/0/clip_codes", "lo < hi"},
       {R"([{"name": "d", "role": "deflection", "clip_codes": [3]}])", "/0/clip_codes", "[lo, hi]"},
       {R"([{"name": "d", "role": "deflection"}, {"name": "d", "role": "z"}])", "/1/name", "earlier"}});
}

TEST(Description, RefusesBadCantilevers) {
  expect_refused(
      decode_cantilever,
      {{"{}", "/modes", "is missing"},
       {R"({"modes": []})", "/modes", "is empty"},
       {R"({"modes": [{"frequency_hz": 0, "quality_factor": 1, "stiffness_n_per_m": 1}]})",
        "/modes/0/frequency_hz", "must be > 0"},
       {R"({"modes": [{"frequency_hz": 1, "quality_factor": -1, "stiffness_n_per_m": 1}]})",
        "/modes/0/quality_factor", "must be > 0"},
       {R"({"modes": [{"frequency_hz": 1, "quality_factor": 1}]})", "/modes/0/stiffness_n_per_m",
        "is missing"},
       {R"({"modes": [{"frequency_hz": 1, "quality_factor": 1, "stiffness_n_per_m": 1, "sensitivity_nm_per_v": 0}]})",
        "/modes/0/sensitivity_nm_per_v", "must not be 0"},
       {R"({"modes": [{"frequency_hz": 1, "quality_factor": 1, "stiffness_n_per_m": 1}], "uncertainty": []})",
        "/uncertainty", "has 0 elements, must have 1"}});
  expect_refused(decode_excitation,
                 {{"{}", "/kind", "is missing"},
                  {R"({"kind": "shaker"})", "/kind", "must be one of"},
                  {R"({"kind": "tip", "participation": [1]})", "/participation", "kind \"base\" alone"},
                  {R"({"kind": "base", "participation": [1, 0]})", "/participation/1", "must not be 0"},
                  {R"({"kind": "base", "participation": []})", "/participation", "is empty"}});
}

TEST(Description, RefusesBadCombs) {
  expect_refused(
      decode_comb,
      {{R"({"tones": [{"bin": 1}]})", "/window_samples", "is missing"},
       {R"({"window_samples": 2, "tones": [{"bin": 1}]})", "/window_samples", "must be in [3, 4294967295]"},
       {R"({"window_samples": 8, "tones": []})", "/tones", "is empty"},
       {R"({"window_samples": 8, "tones": [{"bin": 0}]})", "/tones/0/bin", "must be > 0"},
       {R"({"window_samples": 8, "tones": [{"bin": 4}]})", "/tones/0/bin", "< window_samples/2 = 4"},
       {R"({"window_samples": 9, "tones": [{"bin": 5}]})", "/tones/0/bin", "< window_samples/2 = 4.5"},
       {R"({"window_samples": 8, "tones": [{"bin": 3}, {"bin": 3}]})", "/tones/1/bin", "earlier"},
       {R"({"window_samples": 8, "tones": [{"bin": 3, "driven": 1}]})", "/tones/0/driven", "true or false"}});
}

TEST(Description, RefusesBadFreeResponses) {
  expect_refused(decode_free_response,
                 {{"[]", "", "is empty"},
                  {"[[1, 2, 3]]", "/0", "[re, im]"},
                  {"{}", "/mean_nm", "is missing"},
                  {R"({"mean_nm": [[1, 2]], "covariance": [[1, 0]]})", "/covariance", "must have 2"},
                  {R"({"mean_nm": [[1, 2]], "covariance": [[1, 0], [0]]})", "/covariance/1", "must have 2"},
                  {R"({"mean_nm": [[1, 2]], "lifted_nm": [[1, 2], [3, 4]]})", "/lifted_nm", "must have 1"}});
}

TEST(Description, RefusesBadScansNoiseAndFits) {
  expect_refused(
      decode_scan,
      {{R"({"lines": 0, "columns": 1, "pixel_samples": 1})", "/lines", "must be in [1, 1048576]"},
       {R"({"lines": 1, "columns": 1})", "/pixel_samples", "is missing"},
       {R"({"lines": 1, "columns": 1, "pixel_samples": 1, "windows": 0})", "/windows", "must be in [1,"},
       {R"({"lines": 1, "columns": 1, "pixel_samples": 1, "size_nm": [1]})", "/size_nm", "[x, y]"},
       {R"({"lines": 1, "columns": 1, "pixel_samples": 1, "size_nm": [1, -1]})", "/size_nm/1", ">= 0"}});
  expect_refused(decode_noise,
                 {{R"({"temperature_k": -1, "detector_nm_per_sqrt_hz": 0})", "/temperature_k", ">= 0"},
                  {R"({"temperature_k": 1})", "/detector_nm_per_sqrt_hz", "is missing"},
                  {R"({"temperature_k": 1, "detector_nm_per_sqrt_hz": [0, -1]})",
                   "/detector_nm_per_sqrt_hz/1", ">= 0"}});
  expect_refused(
      decode_fit,
      {{R"({"model": "glue"})", "/model", "dmt"},
       {R"({"refine": 1.5})", "/refine", "integer"},
       {R"({"weighting": "x"})", "/weighting", "must be one of"},
       {R"({"profile_intervals": 1})", "/profile_intervals", "must be true or false"},
       {R"({"calibration_errors": 1})", "/calibration_errors", "must be true or false"},
       {R"({"background": "quadratic"})", "/background", "must be one of"},
       {R"({"compare": ["hertz", "glue"]})", "/compare/1", "dmt"},
       {R"({"compare": ["dmt"]})", "/compare/0", "which is fitted already"},
       {R"({"compare": ["cone", "cone"]})", "/compare/1", "which is fitted already"},
       {R"({"compare": ["hertz"], "bounds": {"debye_length_nm": [1, 2]}})", "/bounds/debye_length_nm",
        "no parameter of model"},
       {R"({"bounds": []})", "/bounds", "must be an object"},
       {R"({"model": "hertz", "bounds": {"adhesion_nn": [0, 1]}})", "/bounds/adhesion_nn", "hertz"},
       {R"({"bounds": {"adhesion_nn": [1, 0]}})", "/bounds/adhesion_nn", "lo < hi"}});
}

TEST(Description, KnowsTheTipOfAFit) {
  const std::string text =
      R"({"model": "hertz", "tip": {"radius_nm": 10, "sample_poisson_ratio": 0.35, "tip_young_modulus_gpa": 170}})";
  const FitSettings fit = decoded(decode_fit, text);
  ASSERT_TRUE(fit.tip);
  EXPECT_EQ(fit.tip->radius_nm, 10.0);
  EXPECT_EQ(fit.tip->tip_young_modulus_gpa, 170.0);
  EXPECT_FALSE(fit.tip->half_angle_deg);
  EXPECT_EQ(decoded(decode_fit, encode(fit).dump()), fit);
  expect_refused(decode_fit,
                 {{R"({"tip": {"radius_nm": 0}})", "/tip", "tip.radius_nm: 0, must be positive"}});
}

TEST(Description, RefusesBadDrives) {
  expect_refused(
      decode_drive,
      {{R"({"scheme": "loud"})", "/scheme", "must be one of"},
       {R"({"total_amplitude_nm": 0})", "/total_amplitude_nm", "> 0"},
       {R"({"amplitudes_nm": [1]})", "/amplitudes_nm", "does not belong to scheme \"equal_energy\""},
       {R"({"scheme": "amplitudes"})", "/amplitudes_nm", "is missing"},
       {R"({"scheme": "amplitudes", "amplitudes_nm": [-1]})", "/amplitudes_nm/0", ">= 0"}});
}

TEST(Description, RefusesObjectsThatContradictEachOther) {
  const std::string comb = R"({"comb": {"window_samples": 100, "tones": [{"bin": 3}, {"bin": 5}]}, )";
  const auto decode = [](const JsonView& view, UnknownKeys unknown) {
    decode_description(view, "", unknown);
  };
  const std::string three = R"("free_response": [[0, 1], [0, 1], [0, 1]]})";
  const std::string noise = R"("noise": {"temperature_k": 1, "detector_nm_per_sqrt_hz": [1, 1, 1]}})";
  const std::string scan =
      R"("scan": {"lines": 1, "columns": 1, "pixel_samples": 249, "settle_samples": 50, "windows": 2}})";
  expect_refused(decode,
                 {{(comb + three).c_str(), "/free_response", "has 3 tones, must have 2"},
                  {(comb + noise).c_str(), "/noise/detector_nm_per_sqrt_hz", "has 3 elements, must have 2"},
                  {(comb + scan).c_str(), "/scan/pixel_samples", "is 249, must be >= 250"}});
  EXPECT_NO_THROW(decoded(decode, "{" + three));  // no comb to contradict
  const std::string one_mode =
      R"({"cantilever": {"modes": [{"frequency_hz": 1, "quality_factor": 1, "stiffness_n_per_m": 1}]}, )";
  expect_refused(decode, {{(one_mode + R"("fit": {"calibration_errors": true}})").c_str(),
                           "/fit/calibration_errors", "uncertainty is not known"},
                          {R"({"fit": {"model": "jkr", "refine": 3}})", "/fit/refine", "depends on history"},
                          {R"({"fit": {"compare": ["hertz", "jkr"], "refine": 3}})", "/fit/refine", "jkr"},
                          {R"({"fit": {"model": "polynomial", "refine": 3}})", "/fit/refine", "known mean"},
                          {R"({"fit": {"model": "capillary", "calibration_errors": true}})",
                           "/fit/calibration_errors", "depends on history"},
                          {(one_mode + R"("excitation": {"kind": "base", "participation": [1, 2]}})").c_str(),
                           "/excitation/participation", "has 2 elements, must have 1"}});
}

}  // namespace
}  // namespace combforce

#include "config/simulation_codec.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "config/configuration.hpp"
#include "tests/unit/proto/input_error.hpp"

namespace combforce {
namespace {

using testing::HasSubstr;

// Every key of the section, none of them at its default.
const std::string complete = R"({"digitizer": {"kind": "simulated", "simulation": {
  "sample_rate_hz": 1e6,
  "cantilever": {"modes": [{"frequency_hz": 1e5, "quality_factor": 100, "stiffness_n_per_m": 2}]},
  "comb": {"window_samples": 1000, "tones": [{"bin": 100}, {"bin": 102, "driven": false}]},
  "drive": {"scheme": "amplitudes", "amplitudes_nm": [30], "phases_rad": [0.5]},
  "model": "hertz",
  "scene": {"kind": "blend", "materials": [{"contact_strength_gpa_sqrt_nm": 1}, {"contact_strength_gpa_sqrt_nm": 2}],
            "step_nm": -4, "grain_nm": 1, "domain_nm": 50, "seed": 7},
  "feedback": {"enabled": false, "set_point": 0.7, "gain": 0.25, "start_z_nm": 30},
  "scan": {"lines": 3, "columns": 5, "pixel_samples": 1500, "settle_samples": 500, "size_nm": [100, 80]},
  "frames": 2, "temperature_k": 4, "detector_nm_per_sqrt_hz": 1e-3, "volts_per_code": 1e-4, "z_nm_per_code": 0,
  "free_seconds": 0.1, "seed": 9007199254740991, "accuracy": "accurate", "paced": false, "block_frames": 100,
  "faults": [{"kind": "lost_block", "sample": 10, "frames": 5}, {"kind": "unknown_loss", "sample": 20, "frames": 6},
             {"kind": "clipped", "sample": 30, "frames": 7}, {"kind": "stall", "sample": 40, "duration_s": 0.5},
             {"kind": "detuned", "sample": 50, "detuning_ppm": -1.5}]
}}})";

SimulationSettings simulation_of(const std::string& text) {
  return parse_configuration(text, "instrument.json").digitizer.simulation;
}

// The complete section with `value` (null: removal) at `pointer` within it; `top`: further keys at the top.
std::string changed(const std::string& pointer, const char* value, const Json& top = Json::object()) {
  Json root = Json::parse(complete);
  const Json::json_pointer place("/digitizer/simulation" + pointer);
  if (value != nullptr) {
    root[place] = Json::parse(value);
  } else {
    root[place.parent_pointer()].erase(place.back());
  }
  root.update(top);
  return root.dump();
}

TEST(SimulationCodec, ReadsEveryKey) {
  const SimulationSettings simulation = simulation_of(complete);
  SimulationSettings expected;
  expected.sample_rate_hz = 1e6;
  expected.cantilever = {{{1e5, 100, 2, 1}}};
  expected.comb = {1000, {{100, true}, {102, false}}};
  expected.drive = {DriveScheme::amplitudes, 50, {30}, {0.5}};
  expected.model = "hertz";
  expected.scene.kind = SceneSettings::Kind::blend;
  expected.scene.materials = {{{1.0}}, {{2.0}}};
  expected.scene.step_nm = -4;
  expected.scene.grain_nm = 1;
  expected.scene.domain_nm = 50;
  expected.scene.seed = 7;
  expected.feedback = {false, 0.7, 0.25, 30};
  expected.layout = {3, 5, 1500, 500, 1, false, {100, 80}};
  expected.frames = 2;
  expected.temperature_k = 4;
  expected.detector_nm_per_sqrt_hz = 1e-3;
  expected.volts_per_code = 1e-4;
  expected.z_nm_per_code = 0;
  expected.free_seconds = 0.1;
  expected.seed = 9007199254740991;
  expected.accuracy = IntegratorAccuracy::accurate;
  expected.paced = false;
  expected.block_frames = 100;
  expected.faults = {{FaultSettings::Kind::lost_block, 10, 5, 0},
                     {FaultSettings::Kind::unknown_loss, 20, 6, 0},
                     {FaultSettings::Kind::clipped, 30, 7, 0},
                     {FaultSettings::Kind::stall, 40, 0, 0.5},
                     {FaultSettings::Kind::detuned, 50, 0, 0.0, -1.5}};
  EXPECT_EQ(simulation, expected);
}

// A key of the settings that is not printed, or not read, shows as a difference.
TEST(SimulationCodec, PrintsWhatItReads) {
  const Configuration configuration = parse_configuration(complete, "instrument.json");
  EXPECT_EQ(parse_configuration(print_configuration(configuration), "instrument.json"), configuration);
  const Json printed = Json::parse(print_configuration(configuration))["digitizer"]["simulation"];
  const Json written = Json::parse(complete)["digitizer"]["simulation"];
  EXPECT_EQ(printed.size(), written.size());
}

TEST(SimulationCodec, TakesFromTheTopWhatItDoesNotSay) {
  Json root = Json::parse(complete);
  Json section = root["digitizer"]["simulation"];
  for (const char* key : {"cantilever", "comb", "scan"}) {
    root[key] = section[key];
    section.erase(key);
  }
  root["fit"] = {{"model", "hertz"}};
  root["noise"] = {{"temperature_k", 77}, {"detector_nm_per_sqrt_hz", 0.002}};
  for (const char* key : {"model", "temperature_k", "detector_nm_per_sqrt_hz"}) section.erase(key);
  root["digitizer"]["simulation"] = section;
  SimulationSettings expected = simulation_of(complete);
  expected.temperature_k = 77;
  expected.detector_nm_per_sqrt_hz = 0.002;
  EXPECT_EQ(simulation_of(root.dump()), expected);
}

TEST(SimulationCodec, PrefersItsOwnWords) {
  const Json top = Json::parse(R"({"cantilever": {"modes": [{"frequency_hz": 9, "quality_factor": 9,
    "stiffness_n_per_m": 9}]}, "fit": {"model": "dmt"}, "noise": {"temperature_k": 9, "detector_nm_per_sqrt_hz": 9}})");
  EXPECT_EQ(simulation_of(changed("/paced", "false", top)), simulation_of(complete));
}

TEST(SimulationCodec, TakesNoDetectorNoiseFromAListPerTone) {
  const Json top = Json::parse(R"({"noise": {"temperature_k": 9, "detector_nm_per_sqrt_hz": [1, 2]}})");
  EXPECT_EQ(simulation_of(changed("/detector_nm_per_sqrt_hz", nullptr, top)).detector_nm_per_sqrt_hz, 0.0);
}

TEST(SimulationCodec, ReadsScenesFromMapsRelativeToTheFile) {
  const std::string text = changed("/scene", R"({"kind": "maps", "height_map": "maps/h.gsf",
                                                 "parameter_maps": {"contact_strength_gpa_sqrt_nm": "/p1.gsf"}})");
  const Configuration configuration = parse_configuration(text, "/etc/combforce/instrument.json");
  const SceneSettings& scene = configuration.digitizer.simulation.scene;
  EXPECT_EQ(scene.kind, SceneSettings::Kind::maps);
  EXPECT_EQ(scene.height_map, "/etc/combforce/maps/h.gsf");
  EXPECT_EQ(scene.parameter_maps, std::vector<std::string>{"/p1.gsf"});
  EXPECT_EQ(parse_configuration(print_configuration(configuration), "elsewhere.json"), configuration);
}

TEST(SimulationCodec, OrdersMaterialParametersAsTheModelDoes) {
  const std::string text = changed("/scene", R"({"kind": "flat", "materials": [
    {"contact_distance_nm": 0.4, "adhesion_nn": 3, "contact_strength_gpa_sqrt_nm": 2}]})");
  Json root = Json::parse(text);
  root["digitizer"]["simulation"]["model"] = "dmt";
  EXPECT_EQ(simulation_of(root.dump()).scene.materials, (std::vector<Material>{{{2, 3, 0.4}}}));
}

struct RefusedSimulation {
  const char* pointer;
  const char* value;
  const char* refused_at;
  const char* message;
};

void PrintTo(const RefusedSimulation& bad, std::ostream* out) {
  *out << bad.pointer << " = " << (bad.value != nullptr ? bad.value : "(removed)");
}

class SimulationRefused : public testing::TestWithParam<RefusedSimulation> {};

TEST_P(SimulationRefused, AtItsPlace) {
  const RefusedSimulation& bad = GetParam();
  const auto error = refusal([&] { simulation_of(changed(bad.pointer, bad.value)); });
  EXPECT_EQ(error.pointer(), std::string("/digitizer/simulation") + bad.refused_at);
  EXPECT_THAT(error.message(), HasSubstr(bad.message));
}

constexpr RefusedSimulation refused_cases[] = {
    {"/sample_rate_hz", nullptr, "/sample_rate_hz", "is missing"},
    {"/sample_rate_hz", "0", "/sample_rate_hz", "must be in [1,"},
    {"/cantilever", nullptr, "/cantilever", "is missing"},
    {"/comb", nullptr, "/comb", "is missing"},
    {"/scan", nullptr, "/scan", "is missing"},
    {"/scene", nullptr, "/scene", "is missing"},
    {"/model", nullptr, "/model", "is missing"},
    {"/model", "\"glue\"", "/model", "glue"},
    {"/model", "\"jkr\"", "/model", "depends on history"},
    {"/model", "\"polynomial\"", "/model", "neither a surface"},
    {"/speed", "1", "/speed", "unknown key"},
    {"/comb/tones/0/bin", "500", "/comb/tones/0/bin", "< window_samples/2 = 500"},
    {"/comb/tones/0/driven", "false", "/comb/tones", "no driven tone"},
    {"/scan/pixel_samples", "1499", "/scan/pixel_samples", "must be >= 1500"},
    {"/drive/amplitudes_nm", "[1, 2]", "/drive/amplitudes_nm", "has 2 elements, must have 1"},
    {"/drive/phases_rad", "[1, 2]", "/drive/phases_rad", "has 2 elements, must have 1"},
    {"/scene/kind", "\"moon\"", "/scene/kind", "must be one of"},
    {"/scene/materials", R"([{"contact_strength_gpa_sqrt_nm": 1}])", "/scene/materials",
     "has 1 elements, must have 2"},
    {"/scene/materials/0/adhesion_nn", "5", "/scene/materials/0/adhesion_nn",
     "no material parameter of model \"hertz\""},
    {"/scene/materials/0/surface_position_nm", "5", "/scene/materials/0/surface_position_nm",
     "no material parameter"},
    {"/scene/materials/0/contact_strength_gpa_sqrt_nm", nullptr,
     "/scene/materials/0/contact_strength_gpa_sqrt_nm", "is missing"},
    {"/scene/materials/0/contact_strength_gpa_sqrt_nm", "-1",
     "/scene/materials/0/contact_strength_gpa_sqrt_nm", "must be in ["},
    {"/scene/domain_nm", "0", "/scene/domain_nm", "> 0"},
    {"/scene/height_map", "\"x\"", "/scene/height_map", "unknown key"},
    {"/feedback/set_point", "1", "/feedback/set_point", "must be in (0, 1)"},
    {"/feedback/gain", "2.5", "/feedback/gain", "must be in [0, 2]"},
    {"/feedback/p", "1", "/feedback/p", "unknown key"},
    {"/frames", "0", "/frames", "must be in [1,"},
    {"/temperature_k", "-1", "/temperature_k", ">= 0"},
    {"/volts_per_code", "-1", "/volts_per_code", ">= 0"},
    {"/free_seconds", "-1", "/free_seconds", ">= 0"},
    {"/free_seconds", "1e30", "/free_seconds", "<= "},
    {"/drive/amplitudes_nm", "[1e300]", "/drive", "must be <= 100000 nm"},
    {"/scene/domain_nm", "1e-3", "/scan/size_nm/0", "must be > 0 and < 1 (1000 times scene.domain_nm)"},
    {"/scan/lines", "1048576", "/scan", "must be <= 4194304"},
    {"/faults/1/sample", "14", "/faults/1/sample", "must be >= 15, the end of the fault before"},
    {"/seed", "9007199254740992", "/seed", "must be in [0,"},
    {"/accuracy", "\"fast\"", "/accuracy", "must be one of"},
    {"/block_frames", "0", "/block_frames", "must be in [1,"},
    {"/faults/1/sample", "9", "/faults/1/sample", "must be in [10,"},
    {"/faults/0/frames", "0", "/faults/0/frames", "must be in [1,"},
    {"/faults/0/duration_s", "1", "/faults/0/duration_s", "unknown key"},
    {"/faults/3/duration_s", "0", "/faults/3/duration_s", "> 0"},
    {"/faults/3/kind", "\"fire\"", "/faults/3/kind", "must be one of"},
};
INSTANTIATE_TEST_SUITE_P(Keys, SimulationRefused, testing::ValuesIn(refused_cases));

TEST(SimulationCodec, NeedsADrivenFirstToneForFeedback) {
  Json root = Json::parse(complete);
  Json& section = root["digitizer"]["simulation"];
  section["comb"]["tones"][0]["driven"] = false;
  section["comb"]["tones"][1]["driven"] = true;
  EXPECT_NO_THROW(simulation_of(root.dump()));
  section["feedback"]["enabled"] = true;
  EXPECT_EQ(refusal([&] { simulation_of(root.dump()); }).pointer(),
            "/digitizer/simulation/comb/tones/0/driven");
}

// What was taken from the top is refused there.
TEST(SimulationCodec, PointsToTheTopWhereItTookAValueFromThere) {
  const Json top = Json::parse(R"({"scan": {"lines": 1, "columns": 1, "pixel_samples": 999}})");
  EXPECT_EQ(refusal([&] { simulation_of(changed("/scan", nullptr, top)); }).pointer(), "/scan/pixel_samples");
}

}  // namespace
}  // namespace combforce

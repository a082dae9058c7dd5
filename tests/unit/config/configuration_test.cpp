#include "config/configuration.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "tests/support/temporary_directory.hpp"
#include "tests/unit/proto/input_error.hpp"

namespace combforce {
namespace {

using ::testing::HasSubstr;

const std::string file = "instrument.json";

Configuration parsed(const std::string& text) {
  return parse_configuration(text, file);
}

InputError refused(const std::string& text) {
  return refusal([&] { parsed(text); });
}

std::string shipped(const std::string& name) {
  return COMBFORCE_SOURCE_DIR "/config/" + name;
}

TEST(Configuration, HasDefaultsForEverything) {
  EXPECT_EQ(parsed("{}"), Configuration{});
  EXPECT_EQ(parsed("{}").digitizer.kind, DigitizerSettings::Kind::none);
}

TEST(Configuration, ReadsEverySection) {
  const Configuration configuration = parsed(R"({
    // comments are allowed
    "digitizer": {"kind": "replay", "replay": {"recording": "/data/REC.sigmf-meta", "realtime": true, "verify": false}},
    "comb": {"window_samples": 588, "tones": [{"bin": 31}]},
    "pipeline": {"threads": 3, "ring_blocks": 16, "pixel_slots": 32, "drift_tolerance": 0.5,
                 "spectrum_segment": 64},
    "server": {"unix_socket": "a.sock", "address": "0.0.0.0", "port": 1, "client_bytes": 65536},
    "record": {"directory": "/tmp"},
    "log_level": "debug" /* and these too */
  })");
  EXPECT_EQ(configuration.digitizer.kind, DigitizerSettings::Kind::replay);
  EXPECT_EQ(configuration.digitizer.replay, (ReplaySettings{"/data/REC.sigmf-meta", true, false}));
  EXPECT_EQ(configuration.description.comb, (Comb{588, {{31, true}}}));
  EXPECT_FALSE(configuration.description.scan);
  EXPECT_EQ(configuration.pipeline, (PipelineSettings{3, 16, 32, 0.5, 64}));
  EXPECT_EQ(configuration.server, (ServerSettings{"a.sock", "0.0.0.0", 1, 65536}));
  EXPECT_EQ(configuration.record.directory, "/tmp");
  EXPECT_EQ(configuration.log_level, "debug");
}

TEST(Configuration, TakesFilesToReadRelativeToItself) {
  const std::string text =
      R"({"digitizer": {"kind": "replay", "replay": {"recording": "../REC.sigmf-meta"}}})";
  const auto recording =
      parse_configuration(text, "/etc/combforce/instrument.json").digitizer.replay.recording;
  EXPECT_EQ(recording, "/etc/REC.sigmf-meta");
}

const char* const calibration = R"({
  "cantilever": {"modes": [{"frequency_hz": 5e4, "quality_factor": 100, "stiffness_n_per_m": 2}]},
  "noise": {"temperature_k": 295, "detector_nm_per_sqrt_hz": 1e-3}})";

TEST(Configuration, IncludesACalibration) {
  const test::TemporaryDirectory directory;
  test::write_file(directory / "probe.json", calibration);
  const auto including = [&](const std::string& more) {
    return parse_configuration(R"({"calibration": "probe.json")" + more + "}", directory / "instrument.json");
  };
  const Configuration configuration = including("");
  EXPECT_EQ(configuration.description.cantilever, (Cantilever{{{5e4, 100, 2, 1}}}));
  EXPECT_EQ(configuration.description.noise, (Noise{295, {1e-3}}));
  EXPECT_EQ(parsed(print_configuration(configuration)), configuration);
  const std::string noise = R"(, "noise": {"temperature_k": 4, "detector_nm_per_sqrt_hz": 0})";
  EXPECT_EQ(including(noise).description.noise, (Noise{4, {0}}));
}

TEST(Configuration, SimulatesTheCantileverOfACalibration) {
  const test::TemporaryDirectory directory;
  test::write_file(directory / "probe.json", calibration);
  const std::string text = R"({"calibration": "probe.json", "digitizer": {"kind": "simulated", "simulation": {
      "sample_rate_hz": 1e6, "comb": {"window_samples": 1000, "tones": [{"bin": 50}]},
      "scan": {"lines": 1, "columns": 1, "pixel_samples": 1000}, "scene": {"kind": "flat", "materials": [{"contact_strength_gpa_sqrt_nm": 1.0}]}, "model": "hertz"}}})";
  const Configuration configuration = parse_configuration(text, directory / "instrument.json");
  EXPECT_EQ(configuration.digitizer.simulation.cantilever, (Cantilever{{{5e4, 100, 2, 1}}}));
  EXPECT_EQ(configuration.digitizer.simulation.temperature_k, 295.0);
}

TEST(Configuration, SaysWhereACalibrationIsWrong) {
  const test::TemporaryDirectory directory;
  std::string bad = calibration;
  bad.replace(bad.find("100"), 3, "-10");
  test::write_file(directory / "probe.json", bad);
  const auto including = [&](const std::string& text) {
    return refusal([&] { parse_configuration(text, directory / "instrument.json"); });
  };
  EXPECT_EQ(including(R"({"calibration": "probe.json"})").what(),
            (directory / "probe.json") + ": /cantilever/modes/0/quality_factor: is -10, must be > 0");
  EXPECT_THAT(including(R"({"calibration": "none.json"})").what(), HasSubstr("none.json: cannot be read"));
  EXPECT_EQ(including(R"({"calibration": ""})").pointer(), "/calibration");
  const InputError twice = including(
      R"({"calibration": "probe.json", "cantilever": {"modes": [{"frequency_hz": 1, "quality_factor": 1,
          "stiffness_n_per_m": 1}]}})");
  EXPECT_EQ(twice.file(), directory / "instrument.json");
  EXPECT_EQ(twice.pointer(), "/calibration");
  EXPECT_THAT(twice.message(), HasSubstr("/cantilever gives too"));
}

TEST(Configuration, PrintsWhatItReads) {
  for (const std::string text :
       {"{}",
        R"({"server": {"unix_socket": "", "port": 0}, "record": {"directory": "rec"}, "log_level": "off"})",
        R"({"digitizer": {"kind": "replay", "replay": {"recording": "a/REC"}}, "free_response": [[0.1, 1e-9]],
            "noise": {"temperature_k": 293.15, "detector_nm_per_sqrt_hz": [1e-4, 3e-5]}})"}) {
    const Configuration configuration = parsed(text);
    EXPECT_EQ(parse_configuration(print_configuration(configuration), "elsewhere/printed.json"),
              configuration)
        << print_configuration(configuration);
  }
}

TEST(Configuration, PrintsEveryDefault) {
  const Json printed = Json::parse(print_configuration({}));
  EXPECT_EQ(printed["server"]["port"], 8720);
  EXPECT_EQ(printed["pipeline"]["pixel_slots"], 256);
  EXPECT_EQ(printed["log_level"], "info");
}

TEST(Configuration, SaysWhichFileWhereAndWhatIsWrong) {
  EXPECT_STREQ(refused(R"({"server": {"port": 65536}})").what(),
               "instrument.json: /server/port: is 65536, must be in [0, 65535]");
  EXPECT_THAT(refused("{\n  \"server\": {]\n}").what(), HasSubstr("instrument.json: line 2, column 14"));
  EXPECT_STREQ(refused(R"({"log_level": "info", "log_level": "off"})").what(),
               "instrument.json: /log_level: duplicate key");
  const std::string absent = "/nowhere/instrument.json";
  EXPECT_THAT(refusal([&] { load_configuration(absent); }).what(), HasSubstr(absent + ": cannot be read"));
}

struct Refused {
  const char* text;
  const char* pointer;
  const char* message;
};

TEST(Configuration, RefusesBadSettings) {
  const Refused cases[] = {
      {"[]", "", "must be an object"},
      {R"({"sever": {}})", "/sever", "unknown key"},
      {R"({"pipeline": {"threads": -1}})", "/pipeline/threads", "must be in [0, 1024]"},
      {R"({"pipeline": {"ring_blocks": 1}})", "/pipeline/ring_blocks", "must be in [2,"},
      {R"({"pipeline": {"pixel_slots": 0}})", "/pipeline/pixel_slots", "must be in [2,"},
      {R"({"pipeline": {"drift_tolerance": 0}})", "/pipeline/drift_tolerance", "must be in (0, 1]"},
      {R"({"pipeline": {"spectrum_segment": 65}})", "/pipeline/spectrum_segment", "is 65, must be even"},
      {R"({"pipeline": {"spectrum_segment": 262144}})", "/pipeline/spectrum_segment",
       "must be in [4, 131072]"},
      {R"({"pipeline": {"slots": 1}})", "/pipeline/slots", "unknown key"},
      {R"({"server": {"address": ""}})", "/server/address", "is empty"},
      {R"({"server": {"client_bytes": 100}})", "/server/client_bytes", "must be in [65536,"},
      {R"({"server": {"unix_socket": 1}})", "/server/unix_socket", "must be a string"},
      {R"({"record": {"directory": ""}})", "/record/directory", "is empty"},
      {R"({"log_level": "loud"})", "/log_level", R"(must be one of "trace")"},
      {R"({"digitizer": {}})", "/digitizer/kind", "is missing"},
      {R"({"digitizer": {"kind": "rx888"}})", "/digitizer/kind", R"(must be one of "simulated", "replay")"},
      {R"({"digitizer": {"kind": "replay"}})", "/digitizer/replay", "is missing"},
      {R"({"digitizer": {"kind": "replay", "simulation": {}}})", "/digitizer/simulation", "unknown key"},
      {R"({"digitizer": {"kind": "replay", "replay": {"recording": ""}}})", "/digitizer/replay/recording",
       "is empty"},
      {R"({"comb": {"window_samples": 8, "tones": [{"bin": 4}]}})", "/comb/tones/0/bin",
       "< window_samples/2"},
      {R"({"comb": {"window_samples": 100, "tones": [{"bin": 4}]},
           "scan": {"lines": 1, "columns": 1, "pixel_samples": 150, "settle_samples": 51}})",
       "/scan/pixel_samples", "must be >= 151"},
  };
  for (const auto& [text, pointer, message] : cases) {
    const auto error = refused(text);
    EXPECT_EQ(error.pointer(), pointer) << text;
    EXPECT_THAT(error.message(), HasSubstr(message)) << text;
  }
  EXPECT_EQ(refused(R"({"server": {"unix_socket": ")" + std::string(108, 'a') + "\"}}").pointer(),
            "/server/unix_socket");
}

class ShippedConfiguration : public ::testing::TestWithParam<const char*> {};

TEST_P(ShippedConfiguration, IsValidAndPrintsTheSame) {
  const Configuration configuration = load_configuration(shipped(GetParam()));
  EXPECT_EQ(parse_configuration(print_configuration(configuration), "elsewhere/printed.json"), configuration);
}

INSTANTIATE_TEST_SUITE_P(Files, ShippedConfiguration,
                         ::testing::Values("demo.json", "paper.json", "foreign-recording.json"));

TEST(ShippedConfigurations, AreAllTested) {
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(COMBFORCE_SOURCE_DIR "/config"))
    if (entry.path().extension() == ".json") ++files;
  EXPECT_EQ(files, 3U);
}

// The demo as the project describes it: 1 kHz comb on the paper's cantilever, 1 ms + 1 ms a pixel.
TEST(ShippedConfigurations, DescribeTheDemo) {
  const Configuration demo = load_configuration(shipped("demo.json"));
  const SimulationSettings& simulation = demo.digitizer.simulation;
  EXPECT_EQ(simulation.sample_rate_hz / static_cast<double>(simulation.comb.window_samples), 1000.0);
  EXPECT_EQ(simulation.comb, (Comb{8000, {{117, true}, {674, true}, {1758, true}, {3235, true}}}));
  EXPECT_EQ(simulation.layout, (ScanLayout{64, 64, 16000, 8000, 1, false, {1000, 1000}}));
  EXPECT_EQ(simulation.scene.kind, SceneSettings::Kind::blend);
  EXPECT_EQ(simulation.cantilever, demo.description.cantilever);
  EXPECT_EQ(simulation.temperature_k, 300.0);
  EXPECT_FALSE(simulation.paced);
}

TEST(ShippedConfigurations, DescribeThePapersInstrument) {
  const SimulationSettings paper = load_configuration(shipped("paper.json")).digitizer.simulation;
  EXPECT_EQ(paper.sample_rate_hz / static_cast<double>(paper.comb.window_samples), 500.0);
  EXPECT_EQ(paper.cantilever,
            (Cantilever{
                {{117e3, 212, 4, 1}, {674e3, 457, 78.5, 1}, {1758e3, 507, 366, 1}, {3235e3, 600, 1330, 1}}}));
  EXPECT_EQ(paper.scene.materials, (std::vector<Material>{{{1.0, 5.0, 0.5}}}));
  EXPECT_EQ(paper.feedback.start_z_nm, 40.0);
}

TEST(ShippedConfigurations, DescribeAForeignRecording) {
  const Configuration foreign = load_configuration(shipped("foreign-recording.json"));
  EXPECT_EQ(foreign.digitizer.kind, DigitizerSettings::Kind::none);
  EXPECT_EQ(foreign.description.comb,
            (Comb{588, {{31, true}, {62, false}, {93, false}, {124, false}, {155, false}}}));
  EXPECT_EQ(foreign.description.channels,
            (Channels{{"deflection", ChannelRole::deflection, "V", 1.0, 0.0, std::nullopt}}));
  EXPECT_FALSE(foreign.description.cantilever);
}

}  // namespace
}  // namespace combforce

#include "proto/sigmf.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "sigmf_example.hpp"

namespace combforce {
namespace {

using testing::HasSubstr;

SigmfMeta parsed(const Json& json) {
  return parse_sigmf_meta(json, example_file);
}

Json minimal() {
  return Json::parse(
      R"({"global": {"core:datatype": "rf32_le", "core:version": "1.0.0", "core:sample_rate": 2},
                         "captures": [], "annotations": []})");
}

TEST(Sigmf, ReadsTheGlobalObject) {
  const SigmfMeta meta = parsed(sigmf_example());
  EXPECT_EQ(meta.datatype, (SigmfDatatype{SigmfDatatype::Kind::i16, false}));
  EXPECT_EQ(meta.sample_rate_hz, 1e6);
  EXPECT_EQ(meta.num_channels, 2U);
  EXPECT_EQ(meta.sha512, std::string(128, 'a'));
  EXPECT_EQ(meta.description.comb, (Comb{100, {{11, true}, {12, false}}}));
  EXPECT_EQ(meta.description.channels.value_or(Channels{}).at(1).name, "z");
  EXPECT_FALSE(meta.description.free_response);
  EXPECT_EQ(meta.truth, Json::parse(R"({"file": "REC.truth.ndjson"})"));
  EXPECT_EQ(meta.rest["core:recorder"], "someone");
  EXPECT_FALSE(meta.rest.contains("afm:comb"));
  EXPECT_THAT(meta.warnings, testing::IsEmpty());
}

TEST(Sigmf, ReadsGapsEpochsStepsAndChanges) {
  const auto captures = parsed(sigmf_example()).captures;
  ASSERT_EQ(captures.size(), 4U);
  EXPECT_EQ(captures[0].global_index, 1000U);
  EXPECT_EQ(captures[0].datetime, "2026-01-02T03:04:05Z");
  EXPECT_EQ(captures[1].global_index, 4500U);
  EXPECT_EQ(captures[2].steps, std::vector<std::uint64_t>{5500});
  EXPECT_EQ(captures[2].changes.free_response.value_or(FreeResponse{}).mean_nm.size(), 2U);
  EXPECT_FALSE(captures[2].changes.comb);
  EXPECT_EQ(captures[2].epoch, 0U);
  EXPECT_EQ(captures[3].epoch, 1U);
  EXPECT_EQ(captures[3].epoch_reason, EpochReason::unknown_loss);
  EXPECT_EQ(captures[3].epoch_first_sample, 10000U);
  EXPECT_EQ(captures[3].scan_ends, (std::vector<std::uint64_t>{10'000, 10'500}));
}

TEST(Sigmf, DropsTheFreeResponseWhereACaptureSaysSo) {
  const SigmfMeta meta = parsed(sigmf_example());
  EXPECT_FALSE(meta.captures[2].drops_free_response);
  EXPECT_TRUE(meta.captures[3].drops_free_response);
  const Description before = in_force_from(meta.captures[2], meta.description);
  EXPECT_EQ(before.free_response, meta.captures[2].changes.free_response);
  EXPECT_EQ(before.comb, meta.description.comb);
  EXPECT_FALSE(in_force_from(meta.captures[3], before).free_response);
}

TEST(Sigmf, ReadsLineMarks) {
  const auto lines = parsed(sigmf_example()).lines;
  ASSERT_EQ(lines.size(), 3U);
  EXPECT_EQ(lines[0].mark, (LineMark{0, 0, Direction::trace, 1000, 2000}));
  EXPECT_EQ(lines[1].mark, (LineMark{2, 0, Direction::retrace, 3400, 2000}));
  EXPECT_EQ(lines[1].sample_start, 2500U);
  EXPECT_EQ(lines[1].sample_count, 1000U);
  EXPECT_EQ(lines[2].sample_count, 0U);
}

TEST(Sigmf, WritesWhatItReads) {
  const Json json = sigmf_example();
  const Json encoded = encode_sigmf(parsed(json));
  EXPECT_EQ(Json::diff(json, encoded), Json::array());  // an empty patch: nothing lost, nothing added
}

TEST(Sigmf, MapsFramesOfTheFileToTheStream) {
  const auto captures = parsed(sigmf_example()).captures;
  EXPECT_EQ(stream_index(captures, 0), 1000U);
  EXPECT_EQ(stream_index(captures, 2999), 3999U);
  EXPECT_EQ(stream_index(captures, 3000), 4500U);
  EXPECT_EQ(stream_index(captures, 1'000'000), 1'004'000U);
}

TEST(Sigmf, FillsInWhatAForeignRecordingLacks) {
  const SigmfMeta meta = parsed(minimal());
  EXPECT_EQ(meta.datatype, (SigmfDatatype{SigmfDatatype::Kind::f32, false}));
  EXPECT_EQ(meta.num_channels, 1U);
  EXPECT_FALSE(meta.sha512);
  EXPECT_EQ(meta.description, Description{});
  EXPECT_TRUE(meta.truth.is_null());
  ASSERT_EQ(meta.captures.size(), 1U);
  EXPECT_EQ(meta.captures[0].sample_start, 0U);
  EXPECT_EQ(meta.captures[0].global_index, 0U);
  EXPECT_THAT(meta.warnings, testing::IsEmpty());
}

TEST(Sigmf, TakesTheGlobalIndexFromTheFileWhenNotSaid) {
  Json json = minimal();
  json["captures"] = Json::parse(R"([{"core:sample_start": 0}, {"core:sample_start": 10}])");
  EXPECT_EQ(parsed(json).captures[1].global_index, 10U);
}

// Line of 50 frames with 20 lost in its midst: 40 … 59 in the file, then 80 … in the stream.
TEST(Sigmf, MapsLinesWithoutIndicesThroughTheCaptures) {
  Json json = minimal();
  json["captures"] = Json::parse(R"([{"core:sample_start": 0, "core:global_index": 0},
                                     {"core:sample_start": 60, "core:global_index": 80}])");
  json["annotations"] = Json::parse(
      R"([{"core:sample_start": 40, "core:sample_count": 50, "core:label": "line", "afm:line": 7}])");
  const SigmfLine line = parsed(json).lines.at(0);
  EXPECT_EQ(line.mark, (LineMark{0, 7, Direction::trace, 40, 70}));
  EXPECT_EQ(line.sample_count, 50U);
}

TEST(Sigmf, EndsALineWithoutCountAtItsCaptureOrItsOwnEnd) {
  Json json = minimal();
  json["captures"] = Json::parse(R"([{"core:sample_start": 0}, {"core:sample_start": 60}])");
  json["annotations"] = Json::parse(
      R"([{"core:sample_start": 40, "core:label": "line", "afm:line": 0},
          {"core:sample_start": 40, "core:label": "line", "afm:line": 1, "afm:line_samples": 15},
          {"core:sample_start": 70, "core:label": "line", "afm:line": 2, "afm:line_samples": 1000}])");
  const auto lines = parsed(json).lines;
  EXPECT_EQ(lines.at(0).mark.line_samples, 20U);
  EXPECT_EQ(lines.at(0).sample_count, 20U);
  EXPECT_EQ(lines.at(1).sample_count, 15U);
  EXPECT_EQ(lines.at(2).sample_count, 1000U);
}

TEST(Sigmf, LeavesAnnotationsOfOthersAlone) {
  Json json = minimal();
  json["annotations"] = Json::parse(R"([{"core:sample_start": 4, "core:label": "line", "rail:track": 2},
                                        {"core:sample_start": 5, "afm:note": "x"}])");
  const SigmfMeta meta = parsed(json);
  EXPECT_THAT(meta.lines, testing::IsEmpty());
  EXPECT_EQ(encode_sigmf(meta)["annotations"], json["annotations"]);
}

TEST(Sigmf, SortsAnnotationsByTheirStart) {
  SigmfMeta meta = parsed(sigmf_example());
  std::ranges::reverse(meta.lines);
  const Json encoded = encode_sigmf(meta);
  EXPECT_EQ(Json::diff(sigmf_example(), encoded), Json::array());
}

TEST(Sigmf, WarnsOfANewerMinorVersionAndKeepsWhatItAdds) {
  Json json = sigmf_example();
  json["global"]["core:extensions"][0]["version"] = "0.2.3";
  json["global"]["afm:tip"] = {{"radius_nm", 10}};
  json["global"]["afm:scan"]["angle_deg"] = 30;
  json["captures"][1]["afm:humidity"] = 0.4;
  json["annotations"][0]["afm:overscan"] = 12;
  const SigmfMeta meta = parsed(json);
  EXPECT_THAT(meta.warnings, testing::ElementsAre(HasSubstr("afm 0.2.3 is newer than 0.1")));
  EXPECT_EQ(meta.rest["afm:tip"]["radius_nm"], 10);
  EXPECT_EQ(Json::diff(json, encode_sigmf(meta)), Json::array());
}

TEST(Sigmf, WarnsOfANewerMinorVersionOfTheStandard) {
  Json json = sigmf_example();
  json["global"]["core:version"] = "1.3.0";
  json["global"]["core:mood"] = "good";
  const SigmfMeta meta = parsed(json);
  EXPECT_THAT(meta.warnings, testing::ElementsAre(HasSubstr("core 1.3.0 is newer than 1.2")));
  EXPECT_EQ(Json::diff(json, encode_sigmf(meta)), Json::array());
}

TEST(Sigmf, WarnsOfAfmKeysItDoesNotKnow) {
  Json json = sigmf_example();
  json["global"]["afm:cantilver"] = 1;
  EXPECT_THAT(parsed(json).warnings, testing::ElementsAre(HasSubstr("/global/afm:cantilver: unknown key")));
}

TEST(Sigmf, AddsItsExtensionToThoseOfOthers) {
  Json json = minimal();
  json["global"]["core:extensions"] =
      Json::parse(R"([{"name": "rail", "version": "9.0.0", "optional": true}])");
  const Json encoded = encode_sigmf(parsed(json));
  EXPECT_EQ(encoded["global"]["core:extensions"].size(), 2U);
  EXPECT_EQ(encoded["global"]["core:extensions"][1],
            Json::parse(R"({"name": "afm", "version": "0.1.0", "optional": true})"));
  EXPECT_EQ(encoded["global"]["core:version"], "1.0.0");
}

TEST(Sigmf, WritesAFreshRecording) {
  SigmfMeta meta;
  meta.sample_rate_hz = 8e6;
  meta.captures.resize(1);
  meta.captures[0].global_index = 70;
  meta.captures[0].epoch = 2;
  meta.captures[0].epoch_reason = EpochReason::clock_change;
  meta.captures[0].epoch_first_sample = 60;
  const Json encoded = encode_sigmf(meta);
  EXPECT_EQ(encoded.dump(),
            R"({"global":{"core:datatype":"ri16_le","core:version":"1.2.5","core:sample_rate":8000000.0,)"
            R"("core:num_channels":1,"core:extensions":[{"name":"afm","version":"0.1.0","optional":true}]},)"
            R"("captures":[{"core:sample_start":0,"core:global_index":70,"afm:epoch":2,)"
            R"("afm:epoch_reason":"clock_change","afm:epoch_first_sample":60}],"annotations":[]})");
  const auto capture = parsed(encoded).captures.at(0);
  EXPECT_EQ(capture.epoch, 2U);
  EXPECT_EQ(capture.epoch_reason, EpochReason::clock_change);
  EXPECT_EQ(capture.epoch_first_sample, 60U);
}

TEST(Sigmf, NamesDatatypes) {
  for (const char* name : {"ri16_le", "ri16_be", "rf32_le", "ri8", "ru8"})
    EXPECT_EQ(to_string(parse_datatype(name)), name);
  EXPECT_EQ(parse_datatype("ri16_be").bytes(), 2U);
  EXPECT_EQ(parse_datatype("rf32_le").bytes(), 4U);
  EXPECT_EQ(parse_datatype("ru8").bytes(), 1U);
  for (const char* name : {"cf32_le", "ri16", "rf64_le", ""})
    EXPECT_THROW(parse_datatype(name), std::invalid_argument) << name;
}

TEST(Sigmf, FindsThePairOfFiles) {
  for (const char* name : {"d/REC", "d/REC.sigmf-meta", "d/REC.sigmf-data"}) {
    EXPECT_EQ(sigmf_paths(name).meta, "d/REC.sigmf-meta");
    EXPECT_EQ(sigmf_paths(name).data, "d/REC.sigmf-data");
  }
}

TEST(Sigmf, ReadsAMeasuredRecording) {
  const std::string path = COMBFORCE_SHARED_DIR "/data/jam_cantilever_1p15MSps.sigmf-meta";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is absent";
  const SigmfMeta meta = read_sigmf_meta(path);
  EXPECT_EQ(meta.sample_rate_hz, 1.15e6);
  EXPECT_EQ(meta.datatype, parse_datatype("ri16_le"));
  EXPECT_EQ(meta.num_channels, 1U);
  EXPECT_EQ(meta.sha512.value_or("").substr(0, 8), "903849f4");
  EXPECT_EQ(meta.captures.size(), 1U);
  EXPECT_THAT(meta.lines, testing::IsEmpty());
  EXPECT_THAT(meta.warnings, testing::IsEmpty());
  EXPECT_THAT(meta.rest["core:description"].get<std::string>(), HasSubstr("Marohn"));
}

}  // namespace
}  // namespace combforce

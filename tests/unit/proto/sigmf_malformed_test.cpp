#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "proto/sigmf.hpp"
#include "sigmf_example.hpp"
#include "tests/unit/proto/input_error.hpp"

namespace combforce {
namespace {

using testing::HasSubstr;

// One change of the example: `value` (absent: removal) at `pointer`, and where and how it is refused.
struct Malformed {
  const char* pointer;
  const char* value;
  const char* refused_at;
  const char* message;
};

Json changed(const char* pointer, const char* value) {
  Json json = sigmf_example();
  const Json::json_pointer place(pointer);
  if (value != nullptr) {
    json[place] = Json::parse(value);
  } else {
    json[place.parent_pointer()].erase(place.back());
  }
  return json;
}

void PrintTo(const Malformed& bad, std::ostream* out) {
  *out << bad.pointer << " = " << (bad.value != nullptr ? bad.value : "(removed)");
}

class SigmfMalformed : public testing::TestWithParam<Malformed> {};

TEST_P(SigmfMalformed, IsRefusedAtItsPlace) {
  const Malformed& bad = GetParam();
  const auto error = refusal([&] { parse_sigmf_meta(changed(bad.pointer, bad.value), example_file); });
  EXPECT_EQ(error.file(), example_file);
  EXPECT_EQ(error.pointer(), bad.refused_at);
  EXPECT_THAT(error.message(), HasSubstr(bad.message));
}

constexpr Malformed global_cases[] = {
    {"/global", nullptr, "/global", "is missing"},
    {"/captures", nullptr, "/captures", "is missing"},
    {"/annotations", nullptr, "/annotations", "is missing"},
    {"/extra", "1", "/extra", "unknown key"},
    {"/global", "[]", "/global", "is an array, must be an object"},
    {"/global/core:version", nullptr, "/global/core:version", "is missing"},
    {"/global/core:version", "\"one\"", "/global/core:version", "must be a version X.Y.Z"},
    {"/global/core:version", "\"2.0.0\"", "/global/core:version", "newer major version of core"},
    {"/global/core:extensions/0/version", "\"1.0.0\"", "/global/core:extensions/0/version",
     "newer major version of afm"},
    {"/global/core:extensions/0/optional", nullptr, "/global/core:extensions/0/optional", "is missing"},
    {"/global/core:extensions/1", R"({"name": "rail", "version": "1.0.0", "optional": false})",
     "/global/core:extensions/1/optional", "needs extension \"rail\""},
    {"/global/core:datatype", nullptr, "/global/core:datatype", "is missing"},
    {"/global/core:datatype", "\"cf32_le\"", "/global/core:datatype", "must be one of ri16_le"},
    {"/global/core:sample_rate", nullptr, "/global/core:sample_rate", "is missing"},
    {"/global/core:sample_rate", "0", "/global/core:sample_rate", "must be in [1, 1000000000000]"},
    {"/global/core:num_channels", "0", "/global/core:num_channels", "must be in [1, 65535]"},
    {"/global/core:num_channels", "1", "/global/afm:channels", "has 2 elements, must have 1"},
    {"/global/core:sha512", "\"abc\"", "/global/core:sha512", "128 hexadecimal digits"},
    {"/global/core:dataset", "\"x.wav\"", "/global/core:dataset", "non-conforming"},
    {"/global/core:metadata_only", "true", "/global/core:metadata_only", "without a dataset"},
    {"/global/core:trailing_bytes", "7", "/global/core:trailing_bytes", "non-conforming"},
    {"/global/core:offset", "7", "/global/core:offset", "split recording"},
    {"/global/afm:comb/window_samples", "\"100\"", "/global/afm:comb/window_samples", "must be an integer"},
    {"/global/afm:comb/tone", "1", "/global/afm:comb/tone", "unknown key"},
    {"/global/afm:scan/pixel_samples", "199", "/global/afm:scan/pixel_samples", "must be >= 200"},
    {"/global/afm:truth", "{}", "/global/afm:truth/model", "is missing"},
};
INSTANTIATE_TEST_SUITE_P(Global, SigmfMalformed, testing::ValuesIn(global_cases));

constexpr Malformed capture_cases[] = {
    {"/captures", "{}", "/captures", "must be an array"},
    {"/captures/1", "3", "/captures/1", "must be an object"},
    {"/captures/1/core:sample_start", nullptr, "/captures/1/core:sample_start", "is missing"},
    {"/captures/1/core:sample_start", "-5", "/captures/1/core:sample_start", "must be in [0,"},
    {"/captures/0/core:sample_start", "5", "/captures/0/core:sample_start", "must be 0 in the first"},
    {"/captures/2/core:sample_start", "2999", "/captures/2/core:sample_start", "out of order"},
    {"/captures/1/core:global_index", "3999", "/captures/1/core:global_index", "must be >= 4000"},
    {"/captures/1/core:global_index", nullptr, "/captures/1", "must be >= 4000"},
    {"/captures/1/core:datetime", "17", "/captures/1/core:datetime", "must be a string"},
    {"/captures/1/core:header_bytes", "16", "/captures/1/core:header_bytes", "non-conforming"},
    {"/captures/2/afm:epoch", "-1", "/captures/2/afm:epoch", "must be in [0,"},
    {"/captures/2/afm:epoch", "2", "/captures/3/afm:epoch", "must be in [2,"},
    {"/captures/3/afm:epoch_first_sample", "10001", "/captures/3/afm:epoch_first_sample",
     "must be in [0, 10000]"},
    {"/captures/3/afm:epoch_reason", "\"bad luck\"", "/captures/3/afm:epoch_reason", "must be one of"},
    {"/captures/2/afm:steps", "[5500, 5499]", "/captures/2/afm:steps/1", "must be in [5500,"},
    {"/captures/2/afm:free_response/mean_nm/2", "[0, 0]", "/captures/2",
     "afm:free_response has 3 tones, must have 2"},
    {"/captures/2/afm:channels", R"([{"name": "d", "role": "deflection"}])", "/captures/2/afm:channels",
     "must have 2"},
};
INSTANTIATE_TEST_SUITE_P(Captures, SigmfMalformed, testing::ValuesIn(capture_cases));

constexpr Malformed annotation_cases[] = {
    {"/annotations", "null", "/annotations", "must be an array"},
    {"/annotations/1/core:sample_start", nullptr, "/annotations/1/core:sample_start", "is missing"},
    {"/annotations/2/core:sample_start", "49", "/annotations/2/core:sample_start", "out of order"},
    {"/annotations/0/core:label", "7", "/annotations/0/core:label", "must be a string"},
    {"/annotations/0/afm:line", nullptr, "/annotations/0/afm:line", "is missing"},
    {"/annotations/0/afm:line", "4294967296", "/annotations/0/afm:line", "must be in [0, 4294967295]"},
    {"/annotations/0/afm:frame", "-1", "/annotations/0/afm:frame", "must be in"},
    {"/annotations/0/afm:direction", "\"up\"", "/annotations/0/afm:direction", "must be one of"},
    {"/annotations/0/afm:line_samples", "0", "/annotations/0/afm:line_samples", "must be in [1,"},
    {"/annotations/0/afm:first_sample", "1001", "/annotations/0", "stream samples 1000 to 2999, must lie in"},
    {"/annotations/0/afm:line_samples", "1999", "/annotations/0", "must lie in the line's 1000 to 2998"},
    // Frames 2500 to 3900 of the file, with the gap of 500 at 3000: one more than the line, 3400 to 5399, has
    // room for.
    {"/annotations/2/core:sample_count", "1401", "/annotations/2",
     "stream samples 3500 to 5400, must lie in"},
    {"/annotations/3/afm:line_samples", nullptr, "/annotations/3", "core:sample_count is 0"},
};
INSTANTIATE_TEST_SUITE_P(Annotations, SigmfMalformed, testing::ValuesIn(annotation_cases));

TEST(SigmfMalformedText, RefusesDuplicateKeys) {
  std::string text = sigmf_example_text;
  const std::string key = "\"core:sample_rate\": 1e6,";
  text.insert(text.find(key), key);
  const auto error = refusal([&] { parse_sigmf_meta(parse_json(text, example_file), example_file); });
  EXPECT_EQ(error.pointer(), "/global/core:sample_rate");
  EXPECT_EQ(error.message(), "duplicate key");
}

// Anything may be refused, but only as an InputError, and what is taken can be written and read again.
void expect_refused_or_readable(const std::string& text) {
  try {
    const SigmfMeta meta = parse_sigmf_meta(parse_json(text, example_file), example_file);
    EXPECT_NO_THROW(parse_sigmf_meta(encode_sigmf(meta), example_file)) << text;
  } catch (const InputError& error) {
    EXPECT_EQ(error.file(), example_file);
    EXPECT_FALSE(error.message().empty());
  }
}

void all_places(const Json& json, const Json::json_pointer& here, std::vector<Json::json_pointer>& places) {
  if (!json.is_structured()) return;
  for (const auto& item : json.items()) {
    const auto place = json.is_array() ? here / std::stoul(item.key()) : here / item.key();
    places.push_back(place);
    all_places(item.value(), place, places);
  }
}

TEST(SigmfMalformedText, NeverCrashesOnAWrongValueAnywhere) {
  std::vector<Json::json_pointer> places;
  all_places(sigmf_example(), Json::json_pointer(), places);
  ASSERT_GT(places.size(), 100U);
  for (const auto& place : places)
    for (const char* value : {"null", "true", "-1", "0", "1.5", "9007199254740991", "1e300", "\"x\"", "[]",
                              "{}", "[[1, 2]]", "{\"a\": 1}"})
      expect_refused_or_readable(changed(place.to_string().c_str(), value).dump());
}

TEST(SigmfMalformedText, NeverCrashesOnDamagedBytes) {
  std::mt19937 random(1);
  const std::string alphabet = "{}[]\":,0123456789.eE-+ \\x/*\n\xff";
  for (int round = 0; round < 3000; ++round) {
    std::string text = sigmf_example_text;
    for (int damage = 0; damage < 1 + round % 4; ++damage) {
      const std::size_t place = random() % text.size();
      switch (random() % 3) {
        case 0:
          text[place] = alphabet[random() % alphabet.size()];
          break;
        case 1:
          text.erase(place, random() % 20);
          break;
        default:
          text.insert(place, text.substr(random() % text.size(), random() % 20));
          break;
      }
    }
    expect_refused_or_readable(text);
  }
}

}  // namespace
}  // namespace combforce

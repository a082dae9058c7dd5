#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "proto/sigmf.hpp"
#include "sigmf_example.hpp"

namespace combforce {
namespace {

const std::string schema = COMBFORCE_SHARED_DIR "/sigmf/sigmf-schema.json";

// The standard's own schema, judged by Debian's python3-jsonschema: nothing of this project takes part.
constexpr auto validate_program =
    "import json, sys, jsonschema\n"
    "schema, meta = (json.load(open(name)) for name in sys.argv[1:])\n"
    "errors = list(jsonschema.Draft202012Validator(schema).iter_errors(meta))\n"
    "for error in errors: print(error.message, list(error.path), file=sys.stderr)\n"
    "sys.exit(1 if errors else 0)\n";

class SigmfSchemaTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(schema)) GTEST_SKIP() << schema << " is absent";
    if (std::system("/usr/bin/python3 -c 'import jsonschema' 2>/dev/null") != 0)
      GTEST_SKIP() << "python3-jsonschema is not installed";
    std::filesystem::create_directory(directory);
    std::ofstream(directory / "validate.py") << validate_program;
  }
  void TearDown() override { std::filesystem::remove_all(directory); }

  bool is_valid(const Json& meta) const {
    std::ofstream(directory / "rec.sigmf-meta") << meta.dump(1);
    const std::string at = directory.string();
    return std::system(("/usr/bin/python3 " + at + "/validate.py '" + schema + "' " + at + "/rec.sigmf-meta")
                           .c_str()) == 0;
  }

  const std::filesystem::path directory =
      std::filesystem::temp_directory_path() / ("combforce_schema_test_" + std::to_string(getpid()));
};

TEST_F(SigmfSchemaTest, AcceptsWhatIsWritten) {
  EXPECT_TRUE(is_valid(encode_sigmf(parse_sigmf_meta(sigmf_example(), "example"))));
}

TEST_F(SigmfSchemaTest, AcceptsAFreshRecording) {
  SigmfMeta meta;
  meta.sample_rate_hz = 8e6;
  meta.captures.resize(1);
  meta.captures[0].global_index = 70;
  meta.captures[0].datetime = "2026-01-02T03:04:05.678Z";
  meta.lines.resize(1);
  meta.lines[0].mark = {0, 1, Direction::retrace, 90, 100};
  meta.lines[0].sample_start = 20;
  meta.lines[0].sample_count = 100;
  EXPECT_TRUE(is_valid(encode_sigmf(meta)));
}

// The validator does judge: a recording without its datatype is no SigMF.
TEST_F(SigmfSchemaTest, RefusesWhatIsNotSigmf) {
  Json json = encode_sigmf(parse_sigmf_meta(sigmf_example(), "example"));
  json["global"].erase("core:datatype");
  EXPECT_FALSE(is_valid(json));
}

}  // namespace
}  // namespace combforce

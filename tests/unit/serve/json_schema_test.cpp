#include "daemon/serve/json_schema.hpp"

#include <gtest/gtest.h>

#include <ostream>
#include <stdexcept>
#include <string>

namespace combforce {
namespace {

const std::string no_file;

struct Case {
  const char* schema;
  const char* good;
  const char* bad;
  const char* pointer;  // of the violation in `bad`
  const char* said;     // part of its message
};

void PrintTo(const Case& c, std::ostream* out) {
  *out << c.schema << " and " << c.bad;
}

class JsonSchema : public testing::TestWithParam<Case> {};

TEST_P(JsonSchema, AcceptsAndRefusesAtTheRightPlace) {
  const Json schema = parse_json(GetParam().schema, no_file);
  const Json good = parse_json(GetParam().good, no_file);
  EXPECT_NO_THROW(check_schema(JsonView(good, no_file), schema));
  const Json bad = parse_json(GetParam().bad, no_file);
  try {
    check_schema(JsonView(bad, no_file), schema);
    FAIL() << "accepted " << GetParam().bad;
  } catch (const InputError& error) {
    EXPECT_EQ(error.pointer(), GetParam().pointer);
    EXPECT_NE(error.message().find(GetParam().said), std::string::npos) << error.message();
  }
}

INSTANTIATE_TEST_SUITE_P(
    Keywords, JsonSchema,
    testing::Values(Case{R"({"type":"object"})", "{}", "[]", "", "not object"},
                    Case{R"({"type":"integer"})", "3", "3.5", "", "not integer"},
                    Case{R"({"type":"number"})", "3", "\"3\"", "", "not number"},
                    Case{R"({"type":"boolean"})", "false", "0", "", "not boolean"},
                    Case{R"({"type":"string"})", "\"\"", "null", "", "not string"},
                    Case{R"({"properties":{"a":{"type":"integer"}}})", R"({"a":1,"b":2})", R"({"a":"x"})",
                         "/a", "not integer"},
                    Case{R"({"required":["a"]})", R"({"a":null})", R"({"b":1})", "/a", "missing"},
                    Case{R"({"properties":{"a":{}},"additionalProperties":false})", R"({"a":1})",
                         R"({"a":1,"b/c":2})", "/b~1c", "unknown"},
                    Case{R"({"items":{"type":"string"}})", R"(["x"])", R"(["x",1])", "/1", "not string"},
                    Case{R"({"minItems":2})", "[1,2]", "[1]", "", "at least 2"},
                    Case{R"({"maxItems":1})", "[1]", "[1,2]", "", "at most 1"},
                    Case{R"({"minimum":1})", "1", "0", "", "below 1"},
                    Case{R"({"maximum":5})", "5", "6", "", "above 5"},
                    Case{R"({"exclusiveMinimum":0})", "0.1", "0", "", "not above 0"},
                    Case{R"({"enum":["a","b"]})", "\"b\"", "\"c\"", "", "none of"},
                    Case{R"({"minLength":1})", "\"a\"", "\"\"", "", "at least 1"},
                    Case{R"({"maxLength":2})", "\"ab\"", "\"abc\"", "", "at most 2"},
                    Case{R"({"pattern":"^[a-z]+$"})", "\"abc\"", "\"a/b\"", "", "does not match"}));

TEST(JsonSchemaItself, MayOnlyUseWhatIsEnforced) {
  const Json value = 1;
  EXPECT_THROW(check_schema(JsonView(value, no_file), {{"multipleOf", 2}}), std::logic_error);
  EXPECT_THROW(check_schema(JsonView(value, no_file), {{"type", "null"}}), std::logic_error);
}

}  // namespace
}  // namespace combforce

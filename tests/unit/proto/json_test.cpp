#include "proto/json.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/unit/proto/input_error.hpp"

namespace combforce {
namespace {

using testing::HasSubstr;

const std::string name = "some.json";

InputError parse_refusal(std::string_view text, Comments comments = Comments::refuse) {
  return refusal([&] { parse_json(text, name, comments); });
}

// Calls `read` with a view of {"x": text}'s member x.
template <typename Read>
auto with_value(const std::string& text, Read read) {
  const Json root = parse_json(R"({"x": )" + text + "}", name);
  return read(JsonView(root, name).get("x"));
}

template <typename Read>
InputError value_refusal(const std::string& text, Read read) {
  return refusal([&] { with_value(text, read); });
}

TEST(Json, KeepsTheTreeAndTheOrderOfKeys) {
  const std::string text = R"({"b":[1,-2,2.5,1e300,true,null,"ü\n\u0041"],"a":{"":{},"c":[]}})";
  EXPECT_EQ(parse_json(text, name), Json::parse(text));
  EXPECT_EQ(parse_json(text, name).dump(), R"({"b":[1,-2,2.5,1e+300,true,null,"ü\nA"],"a":{"":{},"c":[]}})");
}

TEST(Json, NamesFilePlaceAndMessage) {
  const InputError error("f.json", "/a/0", "is 3");
  EXPECT_STREQ(error.what(), "f.json: /a/0: is 3");
  EXPECT_STREQ(InputError("", "/a", "is 3").what(), "/a: is 3");
  EXPECT_STREQ(InputError("f", "", "is 3").what(), "f: is 3");
}

TEST(Json, RefusesADuplicateKeyWithItsPointer) {
  const auto error = parse_refusal(R"({"a": [{}, {"x/y~": 1, "z": 2, "x/y~": 3}], "b": {"x/y~": 1}})");
  EXPECT_EQ(error.pointer(), "/a/1/x~1y~0");
  EXPECT_EQ(error.message(), "duplicate key");
  EXPECT_EQ(error.file(), name);
}

TEST(Json, AcceptsTheSameKeyInDifferentObjects) {
  EXPECT_NO_THROW(parse_json(R"({"a": {"a": {"a": 1}}, "b": [{"a": 1}, {"a": 1}]})", name));
}

TEST(Json, RefusesMalformedTextWithLineAndColumn) {
  EXPECT_THAT(parse_refusal("{\n  \"a\": 1,\n  \"b\": ?\n}").message(), HasSubstr("line 3, column 8"));
  EXPECT_THAT(parse_refusal("").message(), HasSubstr("line 1, column 1"));
  for (const auto* text : {"{", "[1,]", "{\"a\":1,}", "nul", "1 2", "{\"a\" 1}", "'a'", "\"\x01\"", "01",
                           "+1", ".5", "NaN", "Infinity", "\"\xff\"", "{1: 2}", "// c\n1"})
    EXPECT_THAT(parse_refusal(text).message(), HasSubstr("line ")) << text;
}

TEST(Json, TakesCommentsOnlyWhereAllowed) {
  EXPECT_EQ(parse_json("// c\n{\"a\": /* d */ 1}", name, Comments::allow), Json::parse(R"({"a": 1})"));
}

TEST(Json, RefusesNumbersThatDoNotFitADouble) {
  const auto error = parse_refusal(R"({"a": [0, 1e400]})");
  EXPECT_EQ(error.pointer(), "/a/1");
  EXPECT_THAT(error.message(), HasSubstr("1e400"));
  EXPECT_NO_THROW(parse_json("123456789012345678901234567890", name));  // fits, rounded
}

TEST(Json, RefusesDeepNestingInsteadOfOverflowingTheStack) {
  const auto nested = [](std::size_t depth) { return std::string(depth, '[') + std::string(depth, ']'); };
  EXPECT_NO_THROW(parse_json(nested(64), name));
  EXPECT_THAT(parse_refusal(nested(65)).message(), HasSubstr("deeper than 64"));
  EXPECT_THAT(parse_refusal(std::string(1'000'000, '[')).message(), HasSubstr("deeper than 64"));
}

TEST(Json, ReadsAFileOrSaysWhyNot) {
  const auto path = std::filesystem::temp_directory_path() / "combforce_json_test.json";
  std::ofstream(path) << "{\"a\": 1}";
  EXPECT_EQ(parse_json_file(path.string()), Json::parse(R"({"a": 1})"));
  std::filesystem::remove(path);
  EXPECT_THAT(refusal([&] { parse_json_file(path.string()); }).what(),
              HasSubstr(path.string() + ": cannot be read"));
  const auto directory = std::filesystem::temp_directory_path().string();
  EXPECT_THAT(refusal([&] { parse_json_file(directory); }).message(), HasSubstr("is a directory"));
}

TEST(JsonView, FindsMembersAndTheirPlaces) {
  const Json root = parse_json(R"({"a/b": [1, {"c": null}]})", name);
  const JsonView view(root, name);
  EXPECT_EQ(view.get("a/b").elements()[1].get("c").pointer(), "/a~1b/1/c");
  EXPECT_TRUE(view.get("a/b").elements()[1].get("c").json().is_null());
  EXPECT_FALSE(view.find("b"));
  const auto missing = refusal([&] { view.get("b"); });
  EXPECT_EQ(missing.pointer(), "/b");
  EXPECT_EQ(missing.message(), "is missing");
}

TEST(JsonView, RefusesUnknownKeys) {
  const Json root = parse_json(R"({"lines": 1, "colums": 2})", name);
  EXPECT_NO_THROW(JsonView(root, name).only({"lines", "colums"}));
  const auto error = refusal([&] { JsonView(root, name).only({"lines", "columns"}); });
  EXPECT_EQ(error.pointer(), "/colums");
  EXPECT_EQ(error.message(), R"(unknown key "colums"; expected one of "lines", "columns")");
}

TEST(JsonView, RefusesTheWrongTypeAndSaysWhatItFound) {
  const auto object = [](const JsonView& view) { view.find("a"); };
  const auto array = [](const JsonView& view) { view.elements(); };
  const auto number = [](const JsonView& view) { return view.number(); };
  const auto integer = [](const JsonView& view) { return view.integer(); };
  const auto boolean = [](const JsonView& view) { return view.boolean(); };
  const auto string = [](const JsonView& view) { return view.string(); };
  const auto complex = [](const JsonView& view) { return view.complex(); };
  EXPECT_EQ(value_refusal("3", object).message(), "is 3, must be an object");
  EXPECT_EQ(value_refusal("{}", array).message(), "is an object, must be an array");
  EXPECT_EQ(value_refusal("\"1\"", number).message(), "is \"1\", must be a number");
  EXPECT_EQ(value_refusal("[1]", integer).message(), "is an array, must be an integer");
  EXPECT_EQ(value_refusal("0", boolean).message(), "is 0, must be true or false");
  EXPECT_EQ(value_refusal("null", string).message(), "is null, must be a string");
  EXPECT_EQ(value_refusal("[1]", complex).message(), "has 1 elements, must be [re, im]");
  EXPECT_EQ(value_refusal("[1,\"i\"]", complex).pointer(), "/x/1");
}

TEST(JsonView, ChecksTheBoundsOfNumbers) {
  const auto read = [](Range range) { return [range](const JsonView& view) { return view.number(range); }; };
  EXPECT_EQ(with_value("0", read(non_negative)), 0.0);
  EXPECT_EQ(with_value("-1e300", read(any_number)), -1e300);
  EXPECT_EQ(value_refusal("-1", read(non_negative)).message(), "is -1, must be >= 0");
  EXPECT_EQ(value_refusal("0", read(positive)).message(), "is 0, must be > 0");
  EXPECT_EQ(value_refusal("1", read({.lower = 0, .upper = 1, .upper_open = true})).message(),
            "is 1, must be in [0, 1)");
  EXPECT_EQ(value_refusal("2", read({.upper = 1})).message(), "is 2, must be <= 1");
  EXPECT_EQ(with_value("1", read({.lower = 0, .upper = 1})), 1.0);
}

TEST(JsonView, TakesIntegersHoweverTheyAreWritten) {
  const auto any = [](const JsonView& view) { return view.integer(); };
  EXPECT_EQ(with_value("8000", any), 8000U);
  EXPECT_EQ(with_value("8e3", any), 8000U);
  EXPECT_EQ(with_value("9007199254740991", any), 9007199254740991U);
  EXPECT_EQ(value_refusal("1.5", any).message(), "is 1.5, must be an integer");
  for (const auto* text : {"9007199254740992", "18446744073709551616", "1e300", "-1", "-1e300"})
    EXPECT_THAT(value_refusal(text, any).message(), HasSubstr("must be in [0, 9007199254740991]")) << text;
  EXPECT_EQ(value_refusal("2", [](const JsonView& view) { return view.integer(3, 9); }).message(),
            "is 2, must be in [3, 9]");
}

TEST(JsonView, PicksANameFromAList) {
  const auto read = [](const JsonView& view) { return view.one_of({"trace", "retrace"}); };
  EXPECT_EQ(with_value("\"retrace\"", read), 1U);
  EXPECT_EQ(value_refusal("\"back\"", read).message(), R"(is "back", must be one of "trace", "retrace")");
}

TEST(JsonView, ShortensLongValuesInMessages) {
  const auto error =
      value_refusal('"' + std::string(10'000, 'a') + '"', [](const JsonView& view) { return view.number(); });
  EXPECT_LT(error.message().size(), 120U);  // 60 of the value, and the words around it
}

TEST(Number9, RoundsToNineDigitsAndKnowsNoInfinity) {
  EXPECT_EQ(number9(0.1 + 0.2), Json(0.3));
  EXPECT_EQ(number9(123456789.123), Json(123456789.0));
  EXPECT_EQ(number9(-1.23456789012e-30), Json(-1.23456789e-30));
  EXPECT_TRUE(number9(std::numeric_limits<double>::quiet_NaN()).is_null());
  EXPECT_TRUE(number9(-std::numeric_limits<double>::infinity()).is_null());
}

}  // namespace
}  // namespace combforce

#include "proto/gsf.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include "tests/unit/proto/input_error.hpp"

namespace combforce {
namespace {

using testing::HasSubstr;

class GsfTest : public testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directory(directory); }
  void TearDown() override { std::filesystem::remove_all(directory); }

  std::string bytes() const {
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  void write_bytes(const std::string& text) const { std::ofstream(path, std::ios::binary) << text; }
  InputError refused(const std::string& text) const {
    write_bytes(text);
    return refusal([&] { read_gsf(path); });
  }

  const std::filesystem::path directory =
      std::filesystem::temp_directory_path() / ("combforce_gsf_test_" + std::to_string(getpid()));
  const std::string path = (directory / "map.gsf").string();
};

GsfMap map_of(std::uint32_t columns, std::uint32_t lines, std::vector<float> values,
              const std::string& title = "") {
  GsfMap map;
  map.columns = columns;
  map.lines = lines;
  map.values = std::move(values);
  map.title = title;
  return map;
}

std::string data(std::size_t points) {
  return {std::string(4 * points, '\0')};
}

// The bytes as the format's definition has them, put together by hand.
TEST_F(GsfTest, WritesTheFormat) {
  GsfMap map = map_of(2, 1, {1.0F, -2.0F}, "height");
  map.x_m = 1e-6;
  map.y_m = 5e-7;
  map.value_unit = "m";
  write_gsf(path, map);
  const std::string header =
      "Gwyddion Simple Field 1.0\nXRes = 2\nYRes = 1\nXReal = 1e-06\nYReal = 5e-07\nXYUnits = m\nZUnits = m\n"
      "Title = height\n";
  std::string expected = header + std::string(4 - header.size() % 4, '\0');
  expected += std::string("\x00\x00\x80\x3f\x00\x00\x00\xc0", 8);  // 1 and -2, IEEE 754 single, little-endian
  EXPECT_EQ(bytes(), expected);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(directory), {}), 1);  // no temporary file stays
}

TEST_F(GsfTest, ReadsWhatItWritesWhateverThePadding) {
  for (const char* title : {"", "a", "ab", "abc", "abcd"}) {
    const GsfMap map = map_of(3, 2, {0, 1, 2, 3, 4, NAN}, title);
    write_gsf(path, map);
    EXPECT_EQ(bytes().size() % 4, 0U);
    const GsfMap read = read_gsf(path);
    EXPECT_EQ(read.columns, 3U);
    EXPECT_EQ(read.lines, 2U);
    EXPECT_EQ(read.title, title);
    EXPECT_EQ(read.x_m, 0.0);
    EXPECT_EQ(read.value_unit, "");
    EXPECT_THAT(read.values, testing::Pointwise(testing::NanSensitiveFloatEq(), map.values));
  }
}

TEST_F(GsfTest, KeepsExtentsExactly) {
  GsfMap map = map_of(1, 1, {7});
  map.x_m = 1.0 / 3.0;
  map.y_m = 1e-300;
  write_gsf(path, map);
  EXPECT_EQ(read_gsf(path).x_m, 1.0 / 3.0);
  EXPECT_EQ(read_gsf(path).y_m, 1e-300);
}

TEST_F(GsfTest, ReadsForeignHeaders) {
  const std::string header = "Gwyddion Simple Field 1.0\nYRes=1\nXRes  =  1\r\nXOffset = 3\nTitle = a = b\n";
  write_bytes(header + std::string(4 - header.size() % 4, '\0') + data(1));
  EXPECT_EQ(read_gsf(path).title, "a = b");
  EXPECT_EQ(read_gsf(path).values, std::vector<float>{0});
}

TEST_F(GsfTest, RefusesToWriteNonsense) {
  EXPECT_THROW(write_gsf(path, map_of(2, 2, {1, 2, 3})), std::invalid_argument);
  EXPECT_THROW(write_gsf(path, {}), std::invalid_argument);
  EXPECT_THROW(write_gsf(path, map_of(1, 1, {1}, "a\nXRes = 9")), std::invalid_argument);
  const std::string nowhere = (directory / "absent" / "map.gsf").string();
  try {
    write_gsf(nowhere, map_of(1, 1, {1}));
    FAIL() << "was written";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr(nowhere));
  }
}

TEST_F(GsfTest, RefusesMalformedFiles) {
  const std::string magic = "Gwyddion Simple Field 1.0\n";  // 26 bytes
  const std::string good = magic + "XRes = 1\nYRes = 1\n";  // 44 bytes: four NULs follow
  ASSERT_EQ(good.size() % 4, 0U);
  const std::string pad(4, '\0');
  write_bytes(good + pad + data(1));
  ASSERT_NO_THROW(read_gsf(path));

  EXPECT_THAT(refused("").message(), HasSubstr("Gwyddion Simple Field 1.0"));
  EXPECT_THAT(refused("Gwyddion Simple Field 2.0\n").message(), HasSubstr("does not begin"));
  EXPECT_THAT(refused(good).message(), HasSubstr("not ended by a NUL"));
  EXPECT_THAT(refused(good + pad).message(), HasSubstr("has 48 bytes, must have 52"));
  EXPECT_THAT(refused(good + pad + data(2)).message(), HasSubstr("has 56 bytes, must have 52"));
  EXPECT_THAT(refused(good + std::string("\0\0x\0", 4) + data(1)).message(), HasSubstr("padding"));
  EXPECT_THAT(refused(magic + "XRes = 1\n\n" + pad).message(), HasSubstr("no \"key = value\""));
  EXPECT_THAT(refused(magic + "XRes = 1" + pad).message(), HasSubstr("no end"));
  EXPECT_EQ(refused(magic + "XRes = 1\nXRes = 1\n" + pad).what(), path + ": /XRes: duplicate key");
  EXPECT_EQ(refused(magic + "XRes = 1\n" + pad).what(), path + ": /YRes: is missing");
  for (const char* value : {"0", "-1", "1.5", "1048577", "99999999999", "x"})
    EXPECT_EQ(refused(fmt::format("{}XRes = {}\nYRes = 1\n{}", magic, value, pad)).what(),
              fmt::format("{}: /XRes: is \"{}\", must be an integer in [1, 1048576]", path, value));
  EXPECT_THAT(refused(magic + "XRes = 1048576\nYRes = 1048576\n" + pad).message(),
              HasSubstr("must have 4398046511"));
  const auto with = [&](const std::string& line) {
    const std::string header = good + line;
    return header + std::string(4 - header.size() % 4, '\0') + data(1);
  };
  EXPECT_EQ(refused(with("XYUnits = V\n")).pointer(), "/XYUnits");
  EXPECT_EQ(refused(with("XYUnits = m\nXReal = -1\n")).pointer(), "/XReal");
  std::filesystem::remove(path);
  EXPECT_THAT(refusal([&] { read_gsf(path); }).what(), HasSubstr(path + ": cannot be read"));
  EXPECT_THAT(refusal([&] { read_gsf(directory.string()); }).what(), HasSubstr("cannot be read"));
}

}  // namespace
}  // namespace combforce

#include "daemon/cli/maps.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <string>

#include "daemon/cli/pixel_reader.hpp"
#include "proto/gsf.hpp"
#include "proto/pixel_message.hpp"

namespace combforce {
namespace {

using testing::DoubleEq;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::NanSensitiveDoubleEq;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

MapPixel pixel_at(std::uint32_t line, std::uint32_t column, std::vector<NamedValue> values,
                  Direction direction = Direction::trace) {
  return {line, column, direction, FitStatus::converged, {200.0, 100.0}, std::move(values)};
}

TEST(MapWriter, GrowsWithItsPixelsAndLeavesTheRestUnknown) {
  MapWriter maps("");
  EXPECT_THAT(maps.map(Direction::trace, "adhesion_nn"), IsEmpty());
  maps.add(pixel_at(0, 0, {{"adhesion_nn", 1.0}}));
  maps.add(pixel_at(1, 2, {{"adhesion_nn", 2.0}}));
  EXPECT_EQ(maps.lines(), 2U);
  EXPECT_EQ(maps.columns(), 3U);
  const auto unknown = NanSensitiveDoubleEq(nan);
  EXPECT_THAT(maps.map(Direction::trace, "adhesion_nn"),
              ElementsAre(DoubleEq(1.0), unknown, unknown, unknown, unknown, DoubleEq(2.0)));
  EXPECT_THAT(maps.map(Direction::trace, "status"),
              ElementsAre(DoubleEq(0.0), unknown, unknown, unknown, unknown, DoubleEq(0.0)));
  EXPECT_THAT(maps.map(Direction::retrace, "adhesion_nn"), IsEmpty());
  EXPECT_THAT(maps.map(Direction::trace, "nonsense"), IsEmpty());
}

TEST(MapWriter, ALaterPixelReplacesAnEarlierOneAlsoWhereItKnowsLess) {
  MapWriter maps("");
  maps.add(pixel_at(0, 0, {{"z_nm", 40.0}, {"surface_position_nm", -38.0}}));
  EXPECT_THAT(maps.map(Direction::trace, "topography_nm"), ElementsAre(DoubleEq(2.0)));
  maps.add(pixel_at(0, 0, {{"z_nm", 41.0}}));
  EXPECT_THAT(maps.map(Direction::trace, "z_nm"), ElementsAre(DoubleEq(41.0)));
  EXPECT_THAT(maps.map(Direction::trace, "surface_position_nm"), ElementsAre(NanSensitiveDoubleEq(nan)));
  EXPECT_THAT(maps.map(Direction::trace, "topography_nm"), ElementsAre(NanSensitiveDoubleEq(nan)));
}

TEST(MapWriter, LeavesOutAndCountsWhatIsBeyondAnyScan) {
  MapWriter maps("");
  maps.add(pixel_at(MapWriter::max_lines, 0, {{"z_nm", 1.0}}));
  maps.add(pixel_at(0, MapWriter::max_columns, {{"z_nm", 1.0}}));
  EXPECT_EQ(maps.left_out(), 2U);
  EXPECT_EQ(maps.lines(), 0U);
}

TEST(MapWriter, WritesGsfInSiUnits) {
  const std::string directory =
      (std::filesystem::temp_directory_path() / ("combforce-maps-" + std::to_string(::getpid())) / "deep")
          .string();
  MapWriter maps(directory);
  maps.add(pixel_at(0, 0,
                    {{"z_nm", 3.0},
                     {"adhesion_nn", 5.0},
                     {"contact_strength_gpa_sqrt_nm", 1.5},
                     {"cubic_nn_per_nm3", 0.002},
                     {"marker_v", 0.25}}));
  maps.add(pixel_at(0, 1, {{"z_nm", 4.0}}, Direction::retrace));
  maps.write();
  const auto read = [&](const std::string& name) { return read_gsf(directory + "/" + name + ".gsf"); };
  const GsfMap z = read("trace_z_nm");
  EXPECT_EQ(z.columns, 2U);
  EXPECT_EQ(z.lines, 1U);
  EXPECT_DOUBLE_EQ(z.x_m, 200e-9);
  EXPECT_DOUBLE_EQ(z.y_m, 100e-9);
  EXPECT_EQ(z.value_unit, "m");
  EXPECT_FLOAT_EQ(z.values[0], 3e-9F);
  EXPECT_TRUE(std::isnan(z.values[1]));
  EXPECT_EQ(read("trace_adhesion_nn").value_unit, "N");
  EXPECT_FLOAT_EQ(read("trace_adhesion_nn").values[0], 5e-9F);
  EXPECT_EQ(read("trace_contact_strength_gpa_sqrt_nm").value_unit, "");
  EXPECT_FLOAT_EQ(read("trace_contact_strength_gpa_sqrt_nm").values[0], 1.5F);
  EXPECT_EQ(read("trace_cubic_nn_per_nm3").value_unit, "");
  EXPECT_FLOAT_EQ(read("trace_cubic_nn_per_nm3").values[0], 0.002F);
  EXPECT_EQ(read("trace_marker_v").value_unit, "V");
  EXPECT_FLOAT_EQ(read("retrace_z_nm").values[1], 4e-9F);
  std::filesystem::remove_all(std::filesystem::path(directory).parent_path());
}

TEST(MapWriter, SaysWhereItCannotWrite) {
  MapWriter maps("/proc/nowhere");
  EXPECT_THROW(maps.write(), std::runtime_error);
}

// A map made of messages is the map made of the pixels they tell of.
TEST(MapPixels, AreTheSameFromAPixelAndFromItsMessage) {
  Analysis analysis;
  analysis.description.comb = Comb{100, {{10, true}}};
  analysis.description.channels = Channels{{"deflection", ChannelRole::deflection, "V", 1.0, 0.0, {}},
                                           {"z", ChannelRole::z, "nm", 1.0, 0.0, {}},
                                           {"aux", ChannelRole::marker, "V", 1.0, 0.0, {}}};
  analysis.model = &find_model("dmt");
  Pixel pixel;
  pixel.span.line = 3;
  pixel.span.column = 7;
  pixel.span.direction = Direction::retrace;
  pixel.channel_means = {0.0, 38.5, 0.125};
  const std::vector<std::complex<double>> tones{{1.0, 2.0}};
  FitResult fit = unfitted(FitStatus::at_bound, 4);
  fit.parameters = {-40.0, 1.0, 5.0, nan};

  std::string line;
  append_pixel_line(
      line, {pixel, *analysis.description.comb, *analysis.description.channels, tones, analysis.model, fit},
      PixelFields::all);
  const MapPixel read = read_pixel(parse_json(line, "").at("params"));
  const MapPixel direct = map_pixel({pixel, tones, fit, analysis, 0.0});
  EXPECT_EQ(read.line, 3U);
  EXPECT_EQ(read.column, 7U);
  EXPECT_EQ(read.direction, Direction::retrace);
  EXPECT_EQ(read.status, FitStatus::at_bound);
  for (const char* name : {"z_nm", "aux_v", "surface_position_nm", "adhesion_nn", "contact_distance_nm"}) {
    const auto value = [name](const MapPixel& from) {
      for (const NamedValue& v : from.values) {
        if (v.name == name) return v.value;
      }
      ADD_FAILURE() << name << " is missing";
      return nan;
    };
    EXPECT_THAT(value(read), NanSensitiveDoubleEq(value(direct))) << name;
  }
  EXPECT_EQ(read.values.size(), direct.values.size());
}

TEST(PixelReader, RefusesWhatIsNoPixel) {
  EXPECT_THROW(read_pixel(Json::object()), InputError);
  EXPECT_THROW(
      read_pixel(Json::parse(R"({"line":-1,"column":0,"direction":"trace","channels":{},"fit":{}})")),
      InputError);
  EXPECT_THROW(read_pixel(Json::parse(
                   R"({"line":1,"column":0,"direction":"trace","channels":{},"fit":{"status":"great"}})")),
               InputError);
}

}  // namespace
}  // namespace combforce

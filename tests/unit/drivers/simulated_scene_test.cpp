#include "drivers/simulated/scene.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <limits>

#include "proto/gsf.hpp"
#include "proto/json.hpp"

namespace combforce {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

ScanLayout layout(std::uint32_t lines, std::uint32_t columns, double size_nm = 1000.0) {
  ScanLayout scan;
  scan.lines = lines;
  scan.columns = columns;
  scan.size_nm = {size_nm, size_nm};
  return scan;
}

SceneSettings blend(double step_nm, double grain_nm) {
  SceneSettings scene;
  scene.kind = SceneSettings::Kind::blend;
  scene.materials = {{{1.0, 5.0, 0.5}}, {{3.0, 2.0, 0.4}}};
  scene.step_nm = step_nm;
  scene.grain_nm = grain_nm;
  return scene;
}

TEST(Scene, FlatIsOneMaterialAtHeightZero) {
  SceneSettings scene;
  scene.materials = {{{2.0}}};
  const SceneMaps maps = make_scene(scene, find_model("hertz"), layout(2, 3));
  EXPECT_EQ(maps.height_nm, std::vector<double>(6, 0.0));
  ASSERT_EQ(maps.parameters.size(), 1U);
  EXPECT_EQ(maps.parameters[0], std::vector<double>(6, 2.0));
}

// Of a field as often positive as negative, over 10 x 10 domains: about half each.
TEST(Scene, BlendHasBothPhasesAndTheirStep) {
  const SceneMaps maps = make_scene(blend(2.0, 0.0), find_model("dmt"), layout(100, 100, 2000.0));
  int second = 0;
  for (std::size_t i = 0; i < maps.height_nm.size(); ++i) {
    const bool is_second = maps.parameters[0][i] == 3.0;
    second += is_second;
    EXPECT_EQ(maps.height_nm[i], is_second ? 2.0 : 0.0);
    EXPECT_EQ(maps.parameters[1][i], is_second ? 2.0 : 5.0);
    EXPECT_EQ(maps.parameters[2][i], is_second ? 0.4 : 0.5);
  }
  EXPECT_GT(second, 2500);
  EXPECT_LT(second, 7500);
}

TEST(Scene, GrainsAreRoundAndAsHighAsAsked) {
  const SceneMaps maps = make_scene(blend(0.0, 1.5), find_model("dmt"), layout(200, 200));
  const auto [low, high] = std::ranges::minmax_element(maps.height_nm);
  EXPECT_GE(*low, 0.0);
  EXPECT_LE(*high, 1.5);
  EXPECT_GT(*high, 1.4);
  // A cap of radius R = 80 nm falls by at most 2/R of its height per nm, a pixel is 5 nm; valleys are
  // continuous.
  for (std::size_t i = 1; i < maps.height_nm.size(); ++i) {
    if (i % 200 != 0) {
      EXPECT_LE(std::abs(maps.height_nm[i] - maps.height_nm[i - 1]), 1.5 * 2.0 / 80.0 * 5.0 + 1e-12);
    }
  }
}

TEST(Scene, SeedDecidesThePatternAndResolutionDoesNot) {
  const ModelInfo& dmt = find_model("dmt");
  const SceneMaps one = make_scene(blend(2.0, 1.0), dmt, layout(50, 50));
  EXPECT_EQ(one.height_nm, make_scene(blend(2.0, 1.0), dmt, layout(50, 50)).height_nm);
  SceneSettings other = blend(2.0, 1.0);
  other.seed = 2;
  EXPECT_NE(one.height_nm, make_scene(other, dmt, layout(50, 50)).height_nm);
  // Three times as many pixels: the middle ones share their centres.
  const SceneMaps fine = make_scene(blend(2.0, 1.0), dmt, layout(150, 150));
  for (std::uint32_t line = 0; line < 50; ++line) {
    for (std::uint32_t column = 0; column < 50; ++column) {
      EXPECT_NEAR(one.height_nm[one.index(line, column)],
                  fine.height_nm[fine.index(3 * line + 1, 3 * column + 1)], 1e-9);
    }
  }
}

class SceneMapFiles : public ::testing::Test {
 protected:
  void TearDown() override {
    for (const std::string& path : paths) std::filesystem::remove(path);
  }
  std::string write(const std::string& name, std::vector<float> values) {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    const std::filesystem::path path =
        std::filesystem::temp_directory_path() / (std::string(test->name()) + name);
    write_gsf(path.string(), {2, 2, 1e-6, 1e-6, "m", "", std::move(values)});
    return paths.emplace_back(path.string());
  }
  SceneSettings hertz_maps(std::vector<float> strength) {
    SceneSettings scene;
    scene.kind = SceneSettings::Kind::maps;
    scene.height_map = write("height.gsf", {0.0F, 1e-9F, 2e-9F, 3e-9F});
    scene.parameter_maps = {write("strength.gsf", std::move(strength))};
    return scene;
  }
  std::vector<std::string> paths;
};

TEST_F(SceneMapFiles, AreStretchedOverTheScan) {
  const SceneMaps maps =
      make_scene(hertz_maps({1.0F, 2.0F, 3.0F, 4.0F}), find_model("hertz"), layout(2, 4, 0.0));
  ASSERT_EQ(maps.height_nm.size(), 8U);
  const std::vector<double> height{0, 0, 1, 1, 2, 2, 3, 3};
  for (std::size_t i = 0; i < 8; ++i) EXPECT_NEAR(maps.height_nm[i], height[i], 1e-6);
  EXPECT_THAT(maps.parameters[0], ElementsAre(1, 1, 2, 2, 3, 3, 4, 4));
}

TEST_F(SceneMapFiles, ValuesTheModelForbidsAreRefused) {
  for (const float bad : {-1.0F, std::numeric_limits<float>::quiet_NaN()}) {
    try {
      make_scene(hertz_maps({1.0F, 2.0F, bad, 4.0F}), find_model("hertz"), layout(2, 2));
      ADD_FAILURE() << "accepted " << bad;
    } catch (const InputError& error) {
      EXPECT_EQ(error.file(), paths.back());
      EXPECT_THAT(error.what(), HasSubstr("row 1, column 0"));
    }
  }
}

void expect_refused(const SceneSettings& scene, const ScanLayout& scan, const std::string& why) {
  try {
    make_scene(scene, find_model("dmt"), scan);
    ADD_FAILURE() << "accepted; expected: " << why;
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), HasSubstr(why));
  }
}

TEST(Scene, BadSettingsAreNamed) {
  SceneSettings scene = blend(1.0, 1.0);
  expect_refused(scene, layout(4, 4, 0.0), "scan.size_nm[0]: 0");
  expect_refused(scene, layout(4, 4, 1e9), "scan.size_nm[0]: 1000000000, must be > 0 and < ");
  scene.domain_nm = 0.0;
  expect_refused(scene, layout(4, 4), "scene.domain_nm: 0");
  scene = blend(1.0, 1.0);
  scene.materials.pop_back();
  expect_refused(scene, layout(4, 4), "scene.materials: 1, must be 2");
  scene = blend(1.0, 1.0);
  scene.materials[1].parameters.pop_back();
  expect_refused(scene, layout(4, 4), "scene.materials[1]: 2, must be 3 parameters of model dmt");
  scene = blend(1.0, 1.0);
  scene.materials[1].parameters[2] = -0.5;
  expect_refused(scene, layout(4, 4), "scene.materials[1].contact_distance_nm: -0.5");
}

TEST(Scene, StepsAreFoundAlongTheScan) {
  SceneMaps maps;
  maps.lines = 2;
  maps.columns = 3;
  maps.height_nm = {0.0, 0.0,  1.0,  //
                    1.0, 1.05, 1.1};
  maps.parameters = {{1.0, 2.0, 2.0,  //
                      2.0, 2.0, 2.0}};
  ScanLayout scan = layout(2, 3);
  EXPECT_THAT(after_step(maps, scan, Direction::trace, 0.5), ElementsAre(0, 1, 1, 0, 0, 0));
  EXPECT_THAT(after_step(maps, scan, Direction::trace, 0.01), ElementsAre(0, 1, 1, 0, 1, 1));
  scan.bidirectional = true;  // the second line follows the retrace of the first, which ended at column 0
  EXPECT_THAT(after_step(maps, scan, Direction::trace, 0.5), ElementsAre(0, 1, 1, 1, 0, 0));
  EXPECT_THAT(after_step(maps, scan, Direction::retrace, 0.5), ElementsAre(1, 1, 0, 0, 0, 0));
}

}  // namespace
}  // namespace combforce

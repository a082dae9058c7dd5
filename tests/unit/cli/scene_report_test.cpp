#include "daemon/cli/scene_report.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "drivers/simulated/scene.hpp"
#include "fit/force_model.hpp"

namespace combforce {
namespace {

class SceneReport : public testing::Test {
 protected:
  SceneReport() {
    simulation.model = "hertz";
    simulation.scene.kind = SceneSettings::Kind::blend;
    simulation.scene.materials = {{{1.0}}, {{3.0}}};
    simulation.scene.step_nm = 5.0;
    simulation.scene.domain_nm = 100.0;
    layout.lines = layout.columns = 32;
    layout.pixel_samples = 1;
    layout.size_nm = {500.0, 500.0};
    scene = make_scene(simulation.scene, find_model("hertz"), layout);
  }

  // The truth, less what `error` adds to its topography and contact strength.
  template <class Error>
  MapWriter measured(Error error) const {
    MapWriter maps("");
    for (std::uint32_t line = 0; line < layout.lines; ++line) {
      for (std::uint32_t column = 0; column < layout.columns; ++column) {
        const std::size_t at = scene.index(line, column);
        maps.add({line,
                  column,
                  Direction::trace,
                  FitStatus::converged,
                  layout.size_nm,
                  {{"z_nm", 40.0},
                   {"surface_position_nm", scene.height_nm[at] - 40.0 + error(at)},
                   {"contact_strength_gpa_sqrt_nm", scene.parameters[0][at] - error(at)}}});
      }
    }
    return maps;
  }

  SimulationSettings simulation;
  ScanLayout layout;
  SceneMaps scene;
};

TEST_F(SceneReport, TellsStepsFromTheInterior) {
  const std::vector<bool> step = after_step(scene, layout, Direction::trace, scene_step_nm);
  const auto steps = static_cast<std::size_t>(std::ranges::count(step, true));
  ASSERT_GT(steps, 10U);
  const auto errors =
      compare_with_scene(simulation, layout, measured([&](std::size_t at) { return step[at] ? 2.0 : 0.5; }));
  ASSERT_EQ(errors.size(), 2U);
  EXPECT_EQ(errors[0].name, "topography_nm");
  EXPECT_EQ(errors[1].name, "contact_strength_gpa_sqrt_nm");
  for (const SceneError& error : errors) {
    EXPECT_EQ(error.after_step.pixels, steps);
    EXPECT_EQ(error.interior.pixels, std::size_t{32} * 32 - steps);
    EXPECT_EQ(error.interior.missing, 0U);
    // Heights near 40 nm are added and taken away again: a few of their last digits are lost.
    EXPECT_NEAR(error.interior.median, 0.5, 1e-12);
    EXPECT_NEAR(error.interior.percentile_95, 0.5, 1e-12);
    EXPECT_NEAR(error.after_step.median, 2.0, 1e-12);
  }
}

TEST_F(SceneReport, QuantilesAreOfTheAbsoluteErrorAndLeaveOutWhatIsMissing) {
  layout.lines = layout.columns = 10;
  simulation.scene.kind = SceneSettings::Kind::flat;
  simulation.scene.materials.resize(1);
  scene = make_scene(simulation.scene, find_model("hertz"), layout);
  // Pixel i is off by i, alternating in sign; every tenth has no value: 90 remain, 1 to 99.
  const auto errors = compare_with_scene(
      simulation, layout, measured([](std::size_t at) {
        return at % 10 == 0 ? std::nan("") : (at % 2 == 0 ? 1.0 : -1.0) * static_cast<double>(at);
      }));
  EXPECT_EQ(errors[0].interior.missing, 10U);
  EXPECT_NEAR(errors[0].interior.median, 49.0, 1e-9);         // the 45th of the 90 that remain
  EXPECT_NEAR(errors[0].interior.percentile_95, 95.0, 1e-9);  // the 86th
  EXPECT_EQ(errors[0].after_step.pixels, 0U);
  EXPECT_TRUE(std::isnan(errors[0].after_step.median));
}

TEST_F(SceneReport, CountsAsMissingWhatWasNeverScanned) {
  MapWriter maps("");
  maps.add({0,
            0,
            Direction::trace,
            FitStatus::converged,
            layout.size_nm,
            {{"contact_strength_gpa_sqrt_nm", 1.0}}});
  const auto errors = compare_with_scene(simulation, layout, maps);
  EXPECT_EQ(errors[1].interior.missing + errors[1].after_step.missing, 32U * 32U - 1);
}

TEST_F(SceneReport, IsReadableByPeopleAndPrograms) {
  const auto errors = compare_with_scene(simulation, layout, measured([](std::size_t) { return 0.25; }));
  EXPECT_NE(scene_report_markdown(errors).find("| trace topography_nm |"), std::string::npos);
  const Json json = scene_report_json(errors);
  EXPECT_EQ(json["maps"].size(), 2U);
  EXPECT_EQ(json["maps"][1]["interior"]["median"], 0.25);
}

}  // namespace
}  // namespace combforce

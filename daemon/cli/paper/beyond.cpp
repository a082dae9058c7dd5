#include "daemon/cli/paper/beyond.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "daemon/cli/parallel.hpp"

namespace combforce::paper {
namespace {

Unbiased unbiased(const Case& of) {
  const CaseMotion motion = simulate(of);
  FitConditions conditions = fit_conditions(motion);
  Unbiased row{&of, {}, {}, {}};
  PixelFitter(conditions).fit(motion.engaged.tip_nm, row.partial);
  conditions.settings.refine = most_refinements;
  PixelFitter(conditions).fit(motion.engaged.tip_nm, row.refined);
  row.bound = least_errors({of.key, of.label, of.key, {}, 1, 0});
  return row;
}

}  // namespace

Beyond look_beyond(std::size_t most_pixels, const std::function<void(std::string_view)>& step) {
  if (most_pixels < 2)
    throw std::invalid_argument(fmt::format("pixels: {}, must be at least 2", most_pixels));
  Beyond beyond;
  step("the paper's cases without noise");
  beyond.cases.resize(cases().size());
  parallel_for(cases().size(),
               [&] { return [&](std::size_t i) { beyond.cases[i] = unbiased(cases()[i]); }; });
  for (const CoverageCase& of : coverage_cases()) {
    const std::size_t pixels = std::min(most_pixels, of.pixels);
    beyond.coverage.push_back(measure_coverage(of, pixels, [&](std::size_t done) {
      step(fmt::format("error bars: {}, {} of {} pixels", of.label, done, pixels));
    }));
  }
  return beyond;
}

}  // namespace combforce::paper

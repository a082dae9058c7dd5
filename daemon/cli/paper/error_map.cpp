#include "daemon/cli/paper/error_map.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "daemon/cli/paper/parallel.hpp"

namespace combforce::paper {
namespace {

constexpr std::size_t p0_points = 81, p1_points = 60;

std::vector<double> grid(double first, double step, std::size_t points) {
  std::vector<double> values;
  for (std::size_t i = 0; i < points; ++i) values.push_back(first + step * static_cast<double>(i));
  return values;
}

// Well within the width of the minimum in noise (0.1 nm, 5 %), well above the solver's tolerance.
bool is_minimum(const FitResult& fit, const FitResult& minimum) {
  return has_parameters(fit) && std::abs(fit.parameters[0] - minimum.parameters[0]) < 0.01 &&
         std::abs(fit.parameters[1] - minimum.parameters[1]) < 0.01 * minimum.parameters[1];
}

// The longest run of columns p0 in which every start finds the minimum.
void find_safe_range(ErrorMap& map) {
  std::size_t begin = 0, best = 0;
  for (std::size_t i = 0; i < map.p0_nm.size(); ++i) {
    const auto column = map.found.begin() + static_cast<std::ptrdiff_t>(i * map.p1.size());
    if (std::ranges::count(column, column + static_cast<std::ptrdiff_t>(map.p1.size()), 0) != 0) {
      begin = i + 1;
    } else if (i + 1 - begin > best) {
      best = i + 1 - begin;
      map.first_p0_nm = map.p0_nm[begin];
      map.last_p0_nm = map.p0_nm[i];
    }
  }
}

}  // namespace

ErrorMap map_error(const CaseMotion& motion, const FitResult& minimum) {
  ErrorMap map;
  map.of = motion.of;
  map.p0_nm = grid(-50.0, 0.25, p0_points);
  map.p1 = grid(0.05, 0.05, p1_points);
  map.error_nn2.resize(p0_points * p1_points);
  map.found.resize(p0_points * p1_points);
  const FitConditions conditions = fit_conditions(motion);
  parallel_for(p0_points * p1_points, [&] {
    return [&, fitter = std::make_shared<PixelFitter>(conditions)](std::size_t i) {
      const std::array<double, 2> point{map.p0_nm[i / p1_points], map.p1[i % p1_points]};
      map.error_nn2[i] = fitter->error(motion.engaged.tip_nm, point);
      FitResult fit;
      fitter->fit_from(motion.engaged.tip_nm, point, fit);
      map.found[i] = is_minimum(fit, minimum) ? 1 : 0;
    };
  });
  map.found_share =
      static_cast<double>(std::ranges::count(map.found, 1)) / static_cast<double>(map.found.size());
  find_safe_range(map);
  return map;
}

}  // namespace combforce::paper

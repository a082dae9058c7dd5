#include "daemon/cli/paper/error_map.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "daemon/cli/paper/grid_fit.hpp"
#include "daemon/cli/parallel.hpp"

namespace combforce::paper {
namespace {

std::vector<double> grid(double first, double step, std::size_t points) {
  std::vector<double> values;
  for (std::size_t i = 0; i < points; ++i) values.push_back(first + step * static_cast<double>(i));
  return values;
}

// Well within the width of the minimum in noise (0.1 nm, 5 %), well above the solvers' tolerances.
bool is_near(std::span<const double> p, std::span<const double> minimum) {
  return std::abs(p[0] - minimum[0]) < 0.01 && std::abs(p[1] - minimum[1]) < 0.01 * minimum[1];
}

// The longest run of columns p0 in which every start finds the minimum, and the share of all.
void summarize(Starts& starts) {
  std::size_t begin = 0, best = 0;
  for (std::size_t i = 0; i < starts.p0_nm.size(); ++i) {
    const auto column = starts.found.begin() + static_cast<std::ptrdiff_t>(i * starts.p1.size());
    if (std::ranges::count(column, column + static_cast<std::ptrdiff_t>(starts.p1.size()), 0) != 0) {
      begin = i + 1;
    } else if (i + 1 - begin > best) {
      best = i + 1 - begin;
      starts.first_p0_nm = starts.p0_nm[begin];
      starts.last_p0_nm = starts.p0_nm[i];
    }
  }
  starts.found_share =
      static_cast<double>(std::ranges::count(starts.found, 1)) / static_cast<double>(starts.found.size());
}

std::array<double, 2> point(const Starts& starts, std::size_t i) {
  return {starts.p0_nm[i / starts.p1.size()], starts.p1[i % starts.p1.size()]};
}

}  // namespace

ErrorMap map_error(const CaseMotion& motion, const FitResult& minimum) {
  ErrorMap map;
  map.of = motion.of;
  map.p0_nm = grid(-50.0, 0.25, 81);
  map.p1 = grid(0.05, 0.05, 60);
  map.error_nn2.resize(map.p0_nm.size() * map.p1.size());
  const FitConditions conditions = fit_conditions(motion);
  parallel_for(map.error_nn2.size(), [&] {
    return [&, fitter = std::make_shared<PixelFitter>(conditions)](std::size_t i) {
      const std::array<double, 2> p{map.p0_nm[i / map.p1.size()], map.p1[i % map.p1.size()]};
      map.error_nn2[i] = fitter->error(motion.engaged.tip_nm, p);
    };
  });
  map.ours = {map.p0_nm, {1.0}, std::vector<std::uint8_t>(map.p0_nm.size()), 0.0, 0.0, 0.0};
  parallel_for(map.ours.found.size(), [&] {
    return [&, fitter = std::make_shared<PixelFitter>(conditions)](std::size_t i) {
      FitResult fit;
      fitter->fit_from(motion.engaged.tip_nm, point(map.ours, i), fit);
      map.ours.found[i] = has_parameters(fit) && is_near(fit.parameters, minimum.parameters) ? 1 : 0;
    };
  });
  summarize(map.ours);
  map.papers = {
      grid(-50.0, 0.5, 41), grid(0.1, 0.1, 30), std::vector<std::uint8_t>(41UL * 30), 0.0, 0.0, 0.0};
  const GridProblem problem(motion, motion.engaged.tip_nm);
  parallel_for(map.papers.found.size(), [&] {
    return [&](std::size_t i) {
      const GridFit fit = problem.fit(point(map.papers, i));
      map.papers.found[i] = fit.converged && is_near(fit.parameters, minimum.parameters) ? 1 : 0;
    };
  });
  summarize(map.papers);
  return map;
}

}  // namespace combforce::paper

#include "daemon/cli/paper/force_curves.hpp"

#include <algorithm>
#include <cmath>

namespace combforce::paper {
namespace {

constexpr double highest_nm = -35.0;  // the force is all but zero beyond
constexpr double step_nm = 0.02;

std::vector<double> curve(const ModelInfo& model, std::span<const double> parameters,
                          const std::vector<double>& d_nm) {
  std::vector<double> force;
  for (const double d : d_nm) force.push_back(model_force(model, parameters, d));
  return force;
}

void compare(ForceCurves& curves) {
  std::vector<double> largest;
  double squares = 0.0, below = 0.0, points = 0.0;
  for (const std::vector<double>& fitted : curves.fitted_nn) {
    double most = 0.0;
    for (std::size_t i = 0; i < fitted.size(); ++i) {
      const double difference = std::abs(fitted[i] - curves.true_nn[i]);
      most = std::max(most, difference);
      squares += difference * difference;
      below += difference < 1.0 ? 1.0 : 0.0;
      points += 1.0;
    }
    largest.push_back(most);
  }
  if (largest.empty()) return;
  std::ranges::sort(largest);
  curves.median_largest_nn = largest[largest.size() / 2];
  curves.largest_nn = largest.back();
  curves.rms_nn = std::sqrt(squares / points);
  curves.share_below_1_nn = below / points;
}

}  // namespace

ForceCurves force_curves(const CaseMotion& motion, const TableRow& row) {
  const ModelInfo& model = find_model(motion.of->model);
  ForceCurves curves;
  curves.of = motion.of;
  const double deepest = *std::ranges::min_element(motion.engaged.tip_motion_nm);
  const auto points = static_cast<std::size_t>((highest_nm - deepest) / step_nm) + 1;
  for (std::size_t i = 0; i < points; ++i) curves.d_nm.push_back(deepest + step_nm * static_cast<double>(i));
  curves.true_nn = curve(model, motion.of->truth, curves.d_nm);
  for (const FitResult& fit : row.least.fits)
    if (has_parameters(fit))
      curves.fitted_nn.push_back(
          curve(model, std::span(fit.parameters).first(motion.of->truth.size()), curves.d_nm));
  compare(curves);
  return curves;
}

}  // namespace combforce::paper

#include "daemon/cli/paper/tables.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

#include "daemon/cli/paper/parallel.hpp"

namespace combforce::paper {
namespace {

std::vector<double> valid_values(const std::vector<FitResult>& fits, std::size_t parameter) {
  std::vector<double> values;
  for (const FitResult& fit : fits)
    if (has_parameters(fit)) values.push_back(fit.parameters[parameter]);
  return values;
}

}  // namespace

Scatter scatter_of(std::span<const double> values) {
  const auto count = static_cast<double>(values.size());
  Scatter result;
  for (const double value : values) result.mean += value / count;
  double second = 0.0, fourth = 0.0;
  for (const double value : values) {
    const double square = (value - result.mean) * (value - result.mean);
    second += square / count;
    fourth += square * square / count;
  }
  result.spread = std::sqrt(second * count / (count - 1.0));
  result.kurtosis = fourth / (second * second);
  return result;
}

bool has_parameters(const FitResult& fit) {
  return fit.status == FitStatus::converged || fit.status == FitStatus::at_bound ||
         fit.status == FitStatus::ill_conditioned;
}

TableRow fit_case(const CaseMotion& motion) {
  TableRow row;
  row.of = motion.of;
  row.noisy.resize(draws);
  const FitConditions conditions = fit_conditions(motion);
  PixelFitter(conditions).fit(motion.engaged.tip_nm, row.noise_free);
  parallel_for(draws, [&] {
    return [&, fitter = std::make_shared<PixelFitter>(conditions)](std::size_t draw) {
      fitter->fit(noisy_tones(motion, draw), row.noisy[draw]);
    };
  });
  row.valid = static_cast<std::size_t>(std::ranges::count_if(row.noisy, has_parameters));
  for (std::size_t k = 0; k < motion.of->truth.size(); ++k)
    row.scatter.push_back(scatter_of(valid_values(row.noisy, k)));
  return row;
}

}  // namespace combforce::paper

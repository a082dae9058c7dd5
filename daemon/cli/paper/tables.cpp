#include "daemon/cli/paper/tables.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "daemon/cli/parallel.hpp"

namespace combforce::paper {
namespace {

std::vector<double> valid_values(const std::vector<FitResult>& fits, std::size_t parameter) {
  std::vector<double> values;
  for (const FitResult& fit : fits)
    if (has_parameters(fit)) values.push_back(fit.parameters[parameter]);
  return values;
}

// Between the two values next to it; `sorted` is not empty.
double quantile(std::span<const double> sorted, double share) {
  const double place = share * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  return std::lerp(sorted[below], sorted[above], place - static_cast<double>(below));
}

void summarize(Draws& draws, std::size_t parameters) {
  draws.valid = static_cast<std::size_t>(std::ranges::count_if(draws.fits, has_parameters));
  for (std::size_t k = 0; k < parameters; ++k)
    draws.scatter.push_back(scatter_of(valid_values(draws.fits, k)));
}

}  // namespace

Scatter scatter_of(std::span<const double> values) {
  if (values.size() < 2) {
    constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
    return {unknown, unknown, unknown, unknown, unknown, unknown};
  }
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
  std::vector<double> sorted(values.begin(), values.end());
  std::ranges::sort(sorted);
  result.lower = quantile(sorted, 0.16);
  result.median = quantile(sorted, 0.5);
  result.upper = quantile(sorted, 0.84);
  return result;
}

bool has_parameters(const FitResult& fit) {
  return fit.status == FitStatus::converged || fit.status == FitStatus::at_bound ||
         fit.status == FitStatus::ill_conditioned || fit.status == FitStatus::ambiguous;
}

TableRow fit_case(const CaseMotion& motion, std::size_t draws) {
  TableRow row;
  row.of = motion.of;
  row.least.fits.resize(draws);
  row.from_truth.fits.resize(draws);
  const FitConditions conditions = fit_conditions(motion);
  PixelFitter(conditions).fit(motion.engaged.tip_nm, row.noise_free);
  // The fit stays the paper's; knowing the noise, its status says what that leaves undetermined.
  FitConditions noisy = conditions;
  noisy.noise = Noise{temperature_k, {0.0}};
  parallel_for(draws, [&] {
    return [&, fitter = std::make_shared<PixelFitter>(noisy)](std::size_t draw) {
      const std::vector<std::complex<double>> tones = noisy_tones(motion, draw);
      fitter->fit(tones, row.least.fits[draw]);
      fitter->fit_from(tones, motion.of->truth, row.from_truth.fits[draw]);
    };
  });
  summarize(row.least, motion.of->truth.size());
  summarize(row.from_truth, motion.of->truth.size());
  return row;
}

}  // namespace combforce::paper

#include "daemon/cli/paper/remarks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "daemon/cli/paper/grid_fit.hpp"
#include "daemon/cli/parallel.hpp"
#include "proto/pixel_message.hpp"

namespace combforce::paper {
namespace {

// In standard errors: chance puts any of the 28 means and standard deviations in the tables beyond it in one
// study of 20, 2 (1 - Phi(3.12)) = 1 - 0.95^(1/28).
constexpr double significant = 3.12;

std::string list(std::span<const double> values, int decimals) {
  std::string text;
  for (const double value : values)
    text += fmt::format("{}{:.{}f}", text.empty() ? "" : ", ", value, decimals);
  return text;
}

std::string differing(std::span<const double> ours, std::span<const double> printed) {
  std::string names;
  for (std::size_t k = 0; k < printed.size(); ++k)
    if (differs(ours[k], printed[k])) names += fmt::format("{}p{}", names.empty() ? "" : ", ", k);
  return names;
}

// Where the paper's fit ends on our motion, begun at the true parameters, when its samples are displaced by
// fractions of their interval: what of its result is the grid's.
std::vector<std::vector<double>> ends_on_displaced_grids(const CaseMotion& motion) {
  constexpr std::size_t displacements = 16;
  std::vector<GridFit> fits(displacements);
  parallel_for(displacements, [&] {
    return [&](std::size_t i) {
      fits[i] = GridProblem(motion, motion.engaged.tip_nm, static_cast<double>(i) / displacements)
                    .fit(motion.of->truth);
    };
  });
  std::vector<std::vector<double>> ends;
  for (GridFit& fit : fits)
    if (fit.converged) ends.push_back(std::move(fit.parameters));
  return ends;
}

std::string ranges(const std::vector<std::vector<double>>& ends) {
  std::string text;
  for (std::size_t k = 0; !ends.empty() && k < ends[0].size(); ++k) {
    const auto [least, most] =
        std::ranges::minmax(ends, {}, [&](const std::vector<double>& end) { return end[k]; });
    text += fmt::format("{}p{} {:.3f} … {:.3f}", text.empty() ? "" : ", ", k, least[k], most[k]);
  }
  return text;
}

// The least E, converged quadrature, of all parameters that round to the printed ones.
double least_printed_error(const CaseMotion& motion) {
  const double half_digit = 0.5 * std::pow(10.0, -printed_decimals);
  const std::vector<double>& printed = motion.of->printed.noise_free;
  FitConditions conditions = fit_conditions(motion);
  for (std::size_t k = 0; k < printed.size(); ++k)
    conditions.settings.bounds.push_back({std::string(find_model(motion.of->model).parameters[k].name),
                                          printed[k] - half_digit, printed[k] + half_digit});
  PixelFitter fitter(conditions);
  FitResult fit;
  fitter.fit_from(motion.engaged.tip_nm, printed, fit);
  return fitter.error(motion.engaged.tip_nm, std::span(fit.parameters).first(printed.size()));
}

// Differences from what is printed, a parameter each, in units of the sampling error of both sets of draws
// and of the rounding of what is printed.
struct Differences {
  std::vector<double> mean, mean_without_bias, spread;
};

double standardized(double difference, double error) {
  const double rounding = std::pow(10.0, -printed_decimals) / std::sqrt(12.0);
  return difference / std::hypot(error, rounding);
}

Differences differences(const TableRow& row, const std::vector<Scatter>& scatter, std::size_t draws) {
  const Printed& printed = row.of->printed;
  const auto ours_count = static_cast<double>(draws), printed_count = static_cast<double>(all_draws);
  Differences z;
  for (std::size_t k = 0; k < printed.mean.size(); ++k) {
    const Scatter& ours = scatter[k];
    // Of both together, as if they were draws of one distribution.
    const double variance =
        (ours_count * ours.spread * ours.spread + printed_count * printed.spread[k] * printed.spread[k]) /
        (ours_count + printed_count);
    const double mean_error = std::sqrt(variance * (1.0 / ours_count + 1.0 / printed_count));
    // Sampling error of a standard deviation, of that of a mean; no less than a Gaussian's, which few draws
    // understate.
    const double tails = std::sqrt((std::max(ours.kurtosis, 3.0) - 1.0) / 4.0);
    const double bias = row.noise_free.parameters[k] - printed.noise_free[k];
    z.mean.push_back(standardized(ours.mean - printed.mean[k], mean_error));
    z.mean_without_bias.push_back(standardized(ours.mean - bias - printed.mean[k], mean_error));
    z.spread.push_back(standardized(ours.spread - printed.spread[k], tails * mean_error));
  }
  return z;
}

bool by_chance(const std::vector<double>& z) {
  return std::ranges::all_of(z, [](double one) { return std::abs(one) <= significant; });
}

std::string name(const TableRow& row) {
  return fmt::format("{}, {}", row.of->model == "dmt" ? "DMT" : "Hertz", row.of->label);
}

// Our fitter seeks the least E of all; a search from the true parameters stays near them. Empty where that
// makes no difference.
std::vector<std::string> far_remarks(const CaseMotion& motion, const TableRow& row) {
  constexpr double far_nm = 2.0;  // 8 standard deviations of the paper's p0
  PixelFitter fitter(fit_conditions(motion));
  std::size_t far = 0, lower = 0;
  for (std::size_t draw = 0; draw < row.least.fits.size(); ++draw) {
    const FitResult &least = row.least.fits[draw], &near = row.from_truth.fits[draw];
    if (std::abs(least.parameters[0] - row.of->truth[0]) <= far_nm) continue;
    ++far;
    const std::vector<std::complex<double>> tones = noisy_tones(motion, draw);
    const auto error = [&](const FitResult& fit) {
      return fitter.error(tones, std::span(fit.parameters).first(row.of->truth.size()));
    };
    lower += error(least) < error(near) ? 1 : 0;
  }
  if (far == 0) return {};
  return {fmt::format(
      "{}: in {} of {} draws our fitter ends more than {:.0f} nm from the true p0, and in {} of these with a "
      "lower E than a search from the true parameters: one window with this noise does not determine the "
      "case. The draws below, and their statuses, say so; mean and standard deviation do not.",
      name(row), far, row.least.fits.size(), far_nm, lower)};
}

std::string local_remark(const CaseMotion& motion, const TableRow& row) {
  std::vector<GridFit> fits(row.least.fits.size());
  parallel_for(fits.size(), [&] {
    return [&](std::size_t i) { fits[i] = GridProblem(motion, noisy_tones(motion, i)).fit(row.of->truth); };
  });
  std::vector<Scatter> scatter;
  std::string values;
  for (std::size_t k = 0; k < row.of->truth.size(); ++k) {
    std::vector<double> of_parameter;
    for (const GridFit& fit : fits)
      if (fit.converged) of_parameter.push_back(fit.parameters[k]);
    scatter.push_back(scatter_of(of_parameter));
    values +=
        fmt::format("{}{:.2f} ± {:.2f}", values.empty() ? "" : ", ", scatter[k].mean, scatter[k].spread);
  }
  const auto converged = static_cast<std::size_t>(std::ranges::count(fits, true, &GridFit::converged));
  const Differences z = differences(row, scatter, converged);
  return fmt::format(
      "{}: the paper's fit from the true parameters gives {} over the {} of the same {} draws where it "
      "converges: {} (differences of means {}, of standard deviations {} standard errors). The paper does "
      "not say where its searches started.",
      name(row), values, converged, fits.size(),
      by_chance(z.mean) && by_chance(z.spread)
          ? "consistent with the paper's values"
          : "not all consistent with the paper's values, not explained further",
      list(z.mean, 1), list(z.spread, 1));
}

}  // namespace

bool differs(double ours, double printed) {
  const double scale = std::pow(10.0, printed_decimals);
  return std::llround(ours * scale) != std::llround(printed * scale);
}

std::vector<std::string> noise_free_remarks(const CaseMotion& motion, const TableRow& row) {
  const std::vector<double>& printed = row.of->printed.noise_free;
  const std::span<const double> ours = std::span(row.noise_free.parameters).first(printed.size());
  const std::string names = differing(ours, printed);
  if (names.empty()) return {};
  const std::vector<std::vector<double>> ends = ends_on_displaced_grids(motion);
  PixelFitter fitter(fit_conditions(motion));
  const double least = fitter.error(motion.engaged.tip_nm, ours), of_printed = least_printed_error(motion);
  double of_ends = 0.0;
  for (const std::vector<double>& end : ends)
    of_ends = std::max(of_ends, fitter.error(motion.engaged.tip_nm, end));
  return {fmt::format(
      "{}, without noise: {} differ in the last printed digit. The paper's fit, which samples the model "
      "force at 400,000 equal steps, ends on our motion at {}; with its samples displaced by fractions of a "
      "step at {}. E at those ends is up to {:.3g} times its least value; at the parameters that round to "
      "the printed ones it is at least {:.3g} times. {}",
      name(row), names, list(GridProblem(motion, motion.engaged.tip_nm).fit(row.of->truth).parameters, 3),
      ranges(ends), of_ends / least, of_printed / least,
      of_printed <= of_ends
          ? "The printed values are within the error of that grid: it explains the difference."
          : "This alone does not give the printed values.")};
}

std::vector<std::string> scatter_remarks(const CaseMotion& motion, const TableRow& row) {
  const Printed& printed = row.of->printed;
  std::vector<double> means, spreads;
  for (const Scatter& one : row.least.scatter) {
    means.push_back(one.mean);
    spreads.push_back(one.spread);
  }
  std::vector<std::string> remarks;
  const Differences z = differences(row, row.least.scatter, row.least.valid);
  const bool chance_mean = by_chance(z.mean), chance_spread = by_chance(z.spread);
  if (const std::string names = differing(means, printed.mean); !names.empty())
    remarks.push_back(fmt::format(
        "{}, means of {}: {} ({} standard errors; {} without the noise-free difference).", name(row), names,
        chance_mean                      ? "within the sampling error"
        : by_chance(z.mean_without_bias) ? "the noise-free difference, the rest within the sampling error"
                                         : "beyond the sampling error",
        list(z.mean, 1), list(z.mean_without_bias, 1)));
  if (const std::string names = differing(spreads, printed.spread); !names.empty())
    remarks.push_back(fmt::format("{}, standard deviations of {}: {} ({} standard errors).", name(row), names,
                                  chance_spread ? "within the sampling error" : "beyond the sampling error",
                                  list(z.spread, 1)));
  if ((chance_mean || by_chance(z.mean_without_bias)) && chance_spread) return remarks;
  for (std::string& remark : far_remarks(motion, row)) remarks.push_back(std::move(remark));
  remarks.push_back(local_remark(motion, row));
  return remarks;
}

}  // namespace combforce::paper

#include "daemon/cli/paper/remarks.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "daemon/cli/paper/grid_fit.hpp"
#include "daemon/cli/paper/parallel.hpp"
#include "proto/pixel_message.hpp"

namespace combforce::paper {
namespace {

// In standard errors. Of the 28 means and standard deviations in the tables chance puts one beyond in one run
// of 13.
constexpr double significant = 3.0;

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

// How the minimum moves with the quadratures of the tones, by central differences: parameters x (re, im of
// each tone).
Eigen::MatrixXd sensitivity(const CaseMotion& motion, std::span<const double> minimum) {
  constexpr double step_nm = 1e-6;  // moves the most sensitive parameter, DMT's p3, by 0.1 %
  const std::vector<std::complex<double>>& tones = motion.engaged.tip_nm;
  PixelFitter fitter(fit_conditions(motion));
  Eigen::MatrixXd slope(static_cast<Eigen::Index>(minimum.size()),
                        static_cast<Eigen::Index>(2 * tones.size()));
  for (std::size_t column = 0; column < 2 * tones.size(); ++column) {
    const std::complex<double> step =
        column % 2 == 0 ? std::complex<double>(step_nm, 0.0) : std::complex<double>(0.0, step_nm);
    for (const double sign : {1.0, -1.0}) {
      std::vector<std::complex<double>> moved = tones;
      moved[column / 2] += sign * step;
      FitResult fit;
      fitter.fit_from(moved, minimum, fit);
      for (std::size_t k = 0; k < minimum.size(); ++k) {
        double& entry = slope(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(column));
        entry = sign > 0.0 ? fit.parameters[k] : (entry - fit.parameters[k]) / (2.0 * step_nm);
      }
    }
  }
  return slope;
}

// The smallest change of the tones, nm, that moves the minimum by `shift`; its largest quadrature. To first
// order.
double least_tone_error_nm(const CaseMotion& motion, std::span<const double> minimum,
                           std::span<const double> shift) {
  const Eigen::MatrixXd slope = sensitivity(motion, minimum);
  const Eigen::Map<const Eigen::VectorXd> wanted(shift.data(), static_cast<Eigen::Index>(shift.size()));
  return slope.completeOrthogonalDecomposition().solve(wanted).cwiseAbs().maxCoeff();
}

std::vector<double> difference(std::span<const double> a, std::span<const double> b) {
  std::vector<double> result;
  for (std::size_t k = 0; k < a.size(); ++k) result.push_back(a[k] - b[k]);
  return result;
}

// Differences from what is printed, a parameter each, in units of the sampling error of both sets of draws
// and of the rounding of what is printed.
struct Differences {
  std::vector<double> mean, mean_without_bias, spread;
};

double standardized(double difference, double ours_error, double printed_error) {
  const double rounding = std::pow(10.0, -printed_decimals) / std::sqrt(12.0);
  return difference / std::hypot(ours_error, printed_error, rounding);
}

Differences differences(const TableRow& row, const std::vector<Scatter>& scatter, std::size_t count) {
  const Printed& printed = row.of->printed;
  Differences z;
  for (std::size_t k = 0; k < printed.mean.size(); ++k) {
    const Scatter& ours = scatter[k];
    const double ours_error = ours.spread / std::sqrt(static_cast<double>(count));
    const double printed_error = printed.spread[k] / std::sqrt(static_cast<double>(draws));
    const double bias = row.noise_free.parameters[k] - printed.noise_free[k];
    const double tails =
        std::sqrt((ours.kurtosis - 1.0) / 4.0);  // sampling error of a spread, of that of a mean
    z.mean.push_back(standardized(ours.mean - printed.mean[k], ours_error, printed_error));
    z.mean_without_bias.push_back(
        standardized(ours.mean - bias - printed.mean[k], ours_error, printed_error));
    z.spread.push_back(
        standardized(ours.spread - printed.spread[k], tails * ours_error, tails * printed_error));
  }
  return z;
}

bool by_chance(const std::vector<double>& z) {
  return std::ranges::all_of(z, [](double one) { return std::abs(one) <= significant; });
}

std::string name(const TableRow& row) {
  return fmt::format("{}, {}", row.of->model == "dmt" ? "DMT" : "Hertz", row.of->label);
}

std::string statuses(const TableRow& row) {
  std::string names;
  for (const FitResult& fit : row.noisy)
    if (!has_parameters(fit) && names.find(to_string(fit.status)) == std::string::npos)
      names += fmt::format("{}{}", names.empty() ? "" : ", ", to_string(fit.status));
  return names;
}

// The least E of a noisy draw, which our fitter seeks, may lie far from the parameters; a local search stays
// near.
std::string far_remark(const TableRow& row) {
  constexpr double far_nm = 2.0;
  const auto far = std::ranges::count_if(row.noisy, [&](const FitResult& fit) {
    return std::abs(fit.parameters[0] - row.noise_free.parameters[0]) > far_nm;
  });
  return fmt::format(
      "{}: our fitter scans for the least E, and in {} of {} draws finds it with p0 more than {:.0f} nm "
      "away. One "
      "window does not determine this case.",
      name(row), far, draws, far_nm);
}

std::string local_remark(const CaseMotion& motion, const TableRow& row) {
  std::vector<GridFit> fits(draws);
  parallel_for(draws, [&] {
    return [&](std::size_t i) { fits[i] = fit_on_grid(motion, noisy_tones(motion, i), row.of->truth); };
  });
  std::vector<Scatter> scatter;
  std::string values;
  for (std::size_t k = 0; k < row.of->truth.size(); ++k) {
    std::vector<double> of_parameter;
    for (const GridFit& fit : fits) of_parameter.push_back(fit.parameters[k]);
    scatter.push_back(scatter_of(of_parameter));
    values +=
        fmt::format("{}{:.2f} ± {:.2f}", values.empty() ? "" : ", ", scatter[k].mean, scatter[k].spread);
  }
  const Differences z = differences(row, scatter, draws);
  return fmt::format(
      "{}: a local search from the true parameters on the paper's grid of 400,000 samples gives {} over the "
      "same draws "
      "({} of them converged): {} (differences of means {}, of standard deviations {} standard errors). The "
      "paper does "
      "not say where its searches started.",
      name(row), values, std::ranges::count(fits, true, &GridFit::converged),
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
  const std::string place = name(row) + ", without noise";
  const GridFit near = fit_on_grid(motion, motion.engaged.tip_nm, ours);
  const GridFit from_truth = fit_on_grid(motion, motion.engaged.tip_nm, row.of->truth);
  const std::string left = differing(near.parameters, printed),
                    left_too = differing(from_truth.parameters, printed);
  const bool explained = left.empty() || left_too.empty();
  std::vector<std::string> remarks;
  remarks.push_back(fmt::format(
      "{}: {} differ in the last printed digit. The paper transforms the model force sampled at 400,000 "
      "equal steps; on "
      "our motion a search on that grid ends at {}{} from our minimum and at {}{} from the true parameters. "
      "{}",
      place, names, list(near.parameters, 3), near.converged ? "" : " (not converged)",
      list(from_truth.parameters, 3), from_truth.converged ? "" : " (not converged)",
      explained ? "This explains the difference." : "This alone does not give the printed values."));
  if (explained) return remarks;
  remarks.push_back(fmt::format(
      "{}: to first order, errors of {:.2g} pm in the paper's simulated tones would be enough for its values "
      "({:.2g} pm "
      "on its grid). It states neither its tones nor the tolerance of its integrator: not explained further.",
      place, 1e3 * least_tone_error_nm(motion, ours, difference(printed, ours)),
      1e3 * least_tone_error_nm(motion, ours, difference(printed, near.parameters))));
  return remarks;
}

std::vector<std::string> scatter_remarks(const CaseMotion& motion, const TableRow& row) {
  const Printed& printed = row.of->printed;
  std::vector<double> means, spreads;
  for (const Scatter& one : row.scatter) {
    means.push_back(one.mean);
    spreads.push_back(one.spread);
  }
  std::vector<std::string> remarks;
  if (row.valid < draws)
    remarks.push_back(fmt::format("{}, with noise: {} of {} draws gave no parameters ({}) and are left out.",
                                  name(row), draws - row.valid, draws, statuses(row)));
  const Differences z = differences(row, row.scatter, row.valid);
  const bool chance_mean = by_chance(z.mean), chance_spread = by_chance(z.spread);
  if (const std::string names = differing(means, printed.mean); !names.empty())
    remarks.push_back(fmt::format(
        "{}, means of {}: {} ({} standard errors; {} without the noise-free difference).", name(row), names,
        chance_mean                      ? "within 3 standard errors"
        : by_chance(z.mean_without_bias) ? "the noise-free difference, the rest within 3 standard errors"
                                         : "beyond 3 standard errors",
        list(z.mean, 1), list(z.mean_without_bias, 1)));
  if (const std::string names = differing(spreads, printed.spread); !names.empty())
    remarks.push_back(fmt::format("{}, standard deviations of {}: {} ({} standard errors).", name(row), names,
                                  chance_spread ? "within 3 standard errors" : "beyond 3 standard errors",
                                  list(z.spread, 1)));
  if ((chance_mean || by_chance(z.mean_without_bias)) && chance_spread) return remarks;
  remarks.push_back(far_remark(row));
  remarks.push_back(local_remark(motion, row));
  return remarks;
}

}  // namespace combforce::paper

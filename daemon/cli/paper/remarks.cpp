#include "daemon/cli/paper/remarks.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "daemon/cli/paper/grid_fit.hpp"
#include "proto/pixel_message.hpp"

namespace combforce::paper {
namespace {

// Two-sided 5 % of a Gaussian.
constexpr double significant = 2.0;

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

// In units of the sampling error of both sets together and the rounding of what is printed.
double standardized(double ours, double printed, double ours_error, double printed_error) {
  const double rounding = std::pow(10.0, -printed_decimals) / std::sqrt(12.0);
  return (ours - printed) / std::hypot(ours_error, printed_error, rounding);
}

std::string significance(const std::vector<double>& z) {
  return std::ranges::all_of(z, [](double one) { return std::abs(one) <= significant; })
             ? "within the sampling error"
             : "more than sampling error";
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
  std::vector<std::string> remarks;
  remarks.push_back(
      fmt::format("{} of {} ({}) differ in the last printed digit: paper {}; ours {}, with a quadrature "
                  "error below {:.1g}.",
                  names, row.of->label, row.of->model, list(printed, 2), list(ours, 4),
                  std::ranges::max(std::span(row.noise_free.quadrature_errors).first(printed.size()), {},
                                   [](double e) { return std::abs(e); })));
  const GridFit grid = fit_on_grid(motion, motion.engaged.tip_nm, ours);
  const std::string left = differing(grid.parameters, printed);
  remarks.push_back(
      fmt::format("The paper transforms the model force sampled at 400,000 equal steps. On our motion that "
                  "has its minimum at {}{}: {}.",
                  list(grid.parameters, 4), grid.converged ? "" : " (not converged)",
                  left.empty()    ? "this explains the difference"
                  : left == names ? "this does not explain " + left
                                  : "this leaves " + left));
  if (left.empty()) return remarks;
  const double from_ours = least_tone_error_nm(motion, ours, difference(printed, ours));
  const double from_grid = least_tone_error_nm(motion, ours, difference(printed, grid.parameters));
  remarks.push_back(
      fmt::format("Errors of the paper's simulated tones of {:.2g} pm (with its quadrature; {:.2g} pm with "
                  "ours) would, to first order, be enough for its values. It states neither its tones nor "
                  "the tolerance of its integrator: not explained further.",
                  1e3 * from_grid, 1e3 * from_ours));
  return remarks;
}

std::vector<std::string> scatter_remarks(const TableRow& row) {
  const Printed& printed = row.of->printed;
  std::vector<double> means, spreads, z_mean, z_unbiased, z_spread;
  const auto count = static_cast<double>(row.valid);
  for (std::size_t k = 0; k < printed.mean.size(); ++k) {
    const Scatter& ours = row.scatter[k];
    means.push_back(ours.mean);
    spreads.push_back(ours.spread);
    const double of_mean = ours.spread / std::sqrt(count),
                 of_printed_mean = printed.spread[k] / std::sqrt(double(draws));
    const double bias = row.noise_free.parameters[k] - printed.noise_free[k];
    const double relative = std::sqrt((ours.kurtosis - 1.0) / 4.0);
    z_mean.push_back(standardized(ours.mean, printed.mean[k], of_mean, of_printed_mean));
    z_unbiased.push_back(standardized(ours.mean - bias, printed.mean[k], of_mean, of_printed_mean));
    z_spread.push_back(
        standardized(ours.spread, printed.spread[k], relative * of_mean, relative * of_printed_mean));
  }
  std::vector<std::string> remarks;
  if (row.valid < draws) {
    std::string statuses;
    for (const FitResult& fit : row.noisy)
      if (!has_parameters(fit) && statuses.find(to_string(fit.status)) == std::string::npos)
        statuses += fmt::format("{}{}", statuses.empty() ? "" : ", ", to_string(fit.status));
    remarks.push_back(fmt::format("{} ({}): {} of {} draws gave no parameters ({}) and are left out.",
                                  row.of->label, row.of->model, draws - row.valid, draws, statuses));
  }
  if (const std::string names = differing(means, printed.mean); !names.empty())
    remarks.push_back(fmt::format(
        "{} ({}), means of {}: {} (differences {} standard errors{}).", row.of->label, row.of->model, names,
        significance(z_mean) == "within the sampling error" ? significance(z_mean)
        : significance(z_unbiased) == "within the sampling error"
            ? "the noise-free difference, and for the rest sampling error"
            : "more than sampling error, not explained",
        list(z_mean, 1), fmt::format("; {} without the noise-free difference", list(z_unbiased, 1))));
  if (const std::string names = differing(spreads, printed.spread); !names.empty())
    remarks.push_back(fmt::format("{} ({}), standard deviations of {}: {} (differences {} standard errors).",
                                  row.of->label, row.of->model, names, significance(z_spread),
                                  list(z_spread, 1)));
  return remarks;
}

}  // namespace combforce::paper

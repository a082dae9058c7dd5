#include "fit/calibration_errors.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace combforce {
namespace {

// Of a calibrated quantity, of f in half widths of the resonance: small enough for the fit's answer to be
// linear to some percent, and far above what its solutions differ by.
constexpr double step = 1e-3, step_of_paper = 2e-2;

double size(const Mode& mode, const Eigen::Vector4d& logs) {
  return (logs.array() * Eigen::Array4d(2.0 * mode.quality_factor, 1.0, 1.0, 1.0)).abs().maxCoeff();
}

bool holds(FitStatus status) {
  switch (status) {
    case FitStatus::converged:
    case FitStatus::ill_conditioned:
    case FitStatus::at_bound:
    case FitStatus::misfit:
    case FitStatus::ambiguous:
      return true;
    default:
      return false;
  }
}

Mode moved(Mode mode, const Eigen::Vector4d& logs) {
  mode.frequency_hz *= std::exp(logs(0));
  mode.quality_factor *= std::exp(logs(1));
  mode.stiffness_n_per_m *= std::exp(logs(2));
  mode.sensitivity_nm_per_v *= std::exp(logs(3));
  return mode;
}

// Of what is known.
Eigen::Matrix4d known_covariance(const Mode& mode, const ModeUncertainty& uncertainty) {
  const Eigen::Matrix4d covariance = log_covariance(mode, uncertainty);
  return covariance.unaryExpr([](double value) { return std::isfinite(value) ? value : 0.0; });
}

}  // namespace

CalibrationErrors::CalibrationErrors(const FitConditions& conditions)
    : tip_nm_(conditions.comb.tones.size()) {
  const Cantilever& cantilever = conditions.cantilever;
  for (std::size_t m = 0; m < cantilever.modes.size(); ++m) {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> directions(
        known_covariance(cantilever.modes[m], cantilever.uncertainty[m]));
    const Eigen::Vector4d roots = directions.eigenvalues().cwiseMax(0.0).cwiseSqrt();
    for (Eigen::Index i = 0; i < roots.size(); ++i)
      if (roots(i) > 1e-9 * roots.maxCoeff()) add(conditions, m, roots(i) * directions.eigenvectors().col(i));
  }
}

void CalibrationErrors::add(const FitConditions& conditions, std::size_t mode, const Eigen::Vector4d& logs) {
  const double share =
      (conditions.settings.refine > 0 ? step : step_of_paper) / size(conditions.cantilever.modes[mode], logs);
  FitConditions other = conditions;
  other.settings = single_fit(conditions.settings, conditions.settings.model);
  other.cantilever.modes[mode] = moved(conditions.cantilever.modes[mode], share * logs);
  std::vector<std::complex<double>> turns;
  for (const double frequency_hz : frequencies_hz(conditions))
    turns.push_back(tip_per_volt(other.cantilever, frequency_hz) /
                    tip_per_volt(conditions.cantilever, frequency_hz));
  if (other.free_response) {
    const auto turn = [&](std::vector<std::complex<double>>& tones) {
      for (std::size_t i = 0; i < tones.size(); ++i) tones[i] *= turns[i];
    };
    turn(other.free_response->mean_nm);
    if (other.free_response->lifted_nm) turn(*other.free_response->lifted_nm);
  }
  directions_.push_back({PixelFitter(other), std::move(turns), share});
}

void CalibrationErrors::find(std::span<const std::complex<double>> tip_nm, std::uint64_t first_sample,
                             FitResult& result) {
  if (!holds(result.status)) return;
  const std::size_t count = result.parameters_count;
  result.calibration_errors = unknown_values();
  std::array<double, max_parameters> squares{};
  for (Direction& direction : directions_) {
    for (std::size_t i = 0; i < tip_nm_.size(); ++i) tip_nm_[i] = direction.turns[i] * tip_nm[i];
    direction.fitter.fit_from(tip_nm_, {result.parameters.data(), count}, moved_, first_sample);
    if (!holds(moved_.status)) return;
    for (std::size_t k = 0; k < count; ++k)
      squares[k] += std::pow((moved_.parameters[k] - result.parameters[k]) / direction.share, 2);
  }
  for (std::size_t k = 0; k < count; ++k) result.calibration_errors[k] = std::sqrt(squares[k]);
}

}  // namespace combforce

#include "fit/cantilever.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace combforce {
namespace {

void require_positive(std::size_t mode, const char* field, double value) {
  if (!(value > 0.0) || !std::isfinite(value))
    throw std::invalid_argument(
        fmt::format("cantilever.modes[{}].{}: {}, must be positive and finite", mode, field, value));
}

std::array<double, 4> values_of(const Mode& mode) {
  return {mode.frequency_hz, mode.quality_factor, mode.stiffness_n_per_m,
          std::abs(mode.sensitivity_nm_per_v)};
}

Eigen::Index index(std::size_t i) {
  return static_cast<Eigen::Index>(i);
}

// Correlations as some four quantities may have them: not as A with B, B with C, but A against C.
void require_possible(std::size_t mode, const std::array<double, 6>& correlation) {
  if (!std::ranges::all_of(correlation, [](double value) { return std::isfinite(value); })) return;
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  std::size_t next = 0;
  for (Eigen::Index i = 0; i < 4; ++i)
    for (Eigen::Index j = i + 1; j < 4; ++j) matrix(i, j) = matrix(j, i) = correlation[next++];
  const double least =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d>(matrix, Eigen::EigenvaluesOnly).eigenvalues().minCoeff();
  constexpr double rounded = -1e-3;  // written with four digits
  if (!(least >= rounded))
    throw std::invalid_argument(fmt::format(
        "cantilever.uncertainty[{}].correlation: least eigenvalue {:.3g}, must be >= 0", mode, least));
}

}  // namespace

bool ModeUncertainty::operator==(const ModeUncertainty& other) const {
  const auto same = [](double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); };
  return std::ranges::equal(std_errors, other.std_errors, same) &&
         std::ranges::equal(correlation, other.correlation, same);
}

Eigen::Matrix4d log_covariance(const Mode& mode, const ModeUncertainty& uncertainty) {
  const auto values = values_of(mode);
  Eigen::Matrix4d matrix;
  std::size_t next = 0;
  for (std::size_t i = 0; i < values.size(); ++i)
    for (std::size_t j = i; j < values.size(); ++j) {
      const double relative = uncertainty.std_errors[i] * uncertainty.std_errors[j] / (values[i] * values[j]);
      const double correlation = i == j ? 1.0 : uncertainty.correlation[next++];
      matrix(index(i), index(j)) = matrix(index(j), index(i)) = relative * correlation;
    }
  return matrix;
}

ModeUncertainty uncertainty_of(const Mode& mode, const Eigen::Matrix4d& log_covariance) {
  const auto values = values_of(mode);
  ModeUncertainty uncertainty;
  const Eigen::Vector4d relative = log_covariance.diagonal().cwiseSqrt();
  std::size_t next = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    uncertainty.std_errors[i] = relative(index(i)) * values[i];
    for (std::size_t j = i + 1; j < values.size(); ++j) {
      const double size = relative(index(i)) * relative(index(j));
      const double value = std::clamp(log_covariance(index(i), index(j)) / size, -1.0, 1.0);
      uncertainty.correlation[next++] = size == 0.0 ? 0.0 : value;
    }
  }
  return uncertainty;
}

void validate(const Cantilever& cantilever) {
  if (cantilever.modes.empty())
    throw std::invalid_argument("cantilever.modes: empty, at least one mode is needed");
  for (std::size_t m = 0; m < cantilever.modes.size(); ++m) {
    const Mode& mode = cantilever.modes[m];
    require_positive(m, "frequency_hz", mode.frequency_hz);
    require_positive(m, "quality_factor", mode.quality_factor);
    require_positive(m, "stiffness_n_per_m", mode.stiffness_n_per_m);
    if (mode.sensitivity_nm_per_v == 0.0 || !std::isfinite(mode.sensitivity_nm_per_v))
      throw std::invalid_argument(
          fmt::format("cantilever.modes[{}].sensitivity_nm_per_v: {}, must be finite and not zero", m,
                      mode.sensitivity_nm_per_v));
  }
  if (!cantilever.uncertainty.empty() && cantilever.uncertainty.size() != cantilever.modes.size())
    throw std::invalid_argument(fmt::format("cantilever.uncertainty: {} elements, must have {}, one a mode",
                                            cantilever.uncertainty.size(), cantilever.modes.size()));
  for (std::size_t m = 0; m < cantilever.uncertainty.size(); ++m)
    require_possible(m, cantilever.uncertainty[m].correlation);
}

std::complex<double> mode_response(const Mode& mode, double frequency_hz) {
  const double ratio = frequency_hz / mode.frequency_hz;
  return 1.0 /
         (mode.stiffness_n_per_m * std::complex<double>(1.0 - ratio * ratio, ratio / mode.quality_factor));
}

std::complex<double> tip_response(const Cantilever& cantilever, double frequency_hz) {
  std::complex<double> sum = 0.0;
  for (const Mode& mode : cantilever.modes) sum += mode_response(mode, frequency_hz);
  return sum;
}

std::complex<double> detector_response(const Cantilever& cantilever, double frequency_hz) {
  std::complex<double> sum = 0.0;
  for (const Mode& mode : cantilever.modes)
    sum += mode_response(mode, frequency_hz) / mode.sensitivity_nm_per_v;
  return sum;
}

std::complex<double> tip_per_volt(const Cantilever& cantilever, double frequency_hz) {
  return tip_response(cantilever, frequency_hz) / detector_response(cantilever, frequency_hz);
}

double ring_down_s(const Mode& mode) {
  return mode.quality_factor / (std::numbers::pi * mode.frequency_hz);
}

double longest_ring_down_s(const Cantilever& cantilever) {
  double longest = 0.0;
  for (const Mode& mode : cantilever.modes) longest = std::max(longest, ring_down_s(mode));
  return longest;
}

}  // namespace combforce

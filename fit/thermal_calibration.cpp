#include "fit/thermal_calibration.hpp"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>
#include <string>

#include "fit/units.hpp"

namespace combforce {
namespace {

void require(bool good, const std::string& field, double value, const char* bound) {
  if (!good || !std::isfinite(value))
    throw std::invalid_argument(fmt::format("{}: {}, must be {}", field, value, bound));
}

void check(std::span<const MeasuredMode> modes, const CalibrationSettings& settings) {
  require(!modes.empty(), "modes", 0.0, "at least one");
  require(settings.temperature_k > 0.0, "temperature_k", settings.temperature_k, "above 0");
  require(settings.correction_factor > 0.0, "correction_factor", settings.correction_factor, "above 0");
  require(settings.relative_error >= 0.0, "relative_error", settings.relative_error, "at least 0");
  const bool sader = settings.known == KnownQuantity::sader;
  const std::size_t count = settings.values.size();
  if (sader ? count != 0 : count != 1 && count != modes.size())
    throw std::invalid_argument(fmt::format(
        "values: {} of the known quantity, must be {}", count,
        sader ? "none: Sader's method gives them" : fmt::format("one, or {}, one a mode", modes.size())));
  if (sader && !settings.beam)
    throw std::invalid_argument("beam: absent, Sader's method needs plan dimensions and fluid");
  for (std::size_t i = 0; i < count; ++i)
    require(settings.values[i] > 0.0, fmt::format("values[{}]", i), settings.values[i], "above 0");
  if (!settings.mode_numbers.empty() && settings.mode_numbers.size() != modes.size())
    throw std::invalid_argument(fmt::format("mode_numbers: {}, must be as many as modes: {}",
                                            settings.mode_numbers.size(), modes.size()));
  for (std::size_t i = 0; i < settings.mode_numbers.size(); ++i)
    require(settings.mode_numbers[i] > (i == 0 ? 0 : settings.mode_numbers[i - 1]),
            fmt::format("mode_numbers[{}]", i), settings.mode_numbers[i], "ascending from 1 on");
}

// What is known, as far as it is, and how ln of it moves with (ln f0, ln Q, ln P) of the mode.
struct Known {
  double value;
  bool is_stiffness;
  Eigen::Vector3d by_logs = Eigen::Vector3d::Zero();
  double relative_error;
};

Known known_of_first(const MeasuredMode& first, const CalibrationSettings& settings) {
  if (settings.known != KnownQuantity::sader)
    return {settings.values.front(), settings.known == KnownQuantity::stiffness, Eigen::Vector3d::Zero(),
            settings.relative_error};
  const SaderStiffness sader =
      sader_stiffness(*settings.beam, first.mode.frequency_hz, first.mode.quality_factor);
  return {sader.stiffness_n_per_m, true, {sader.log_by_log_frequency, 1.0, 0.0}, settings.relative_error};
}

// ln k + 2 ln alpha = ln(c kB T) - ln P.
void complete(const MeasuredMode& measured, const Known& known, const CalibrationSettings& settings,
              Cantilever& result) {
  const double energy = settings.correction_factor * boltzmann_nn_nm_per_k * settings.temperature_k;
  const FittedMode& fitted = measured.mode;
  Mode mode{fitted.frequency_hz, fitted.quality_factor, known.value, known.value};
  // Rows: ln f0, ln Q, ln k, ln alpha; columns: ln f0, ln Q, ln P, ln of the known quantity's own error.
  Eigen::Matrix4d rows = Eigen::Matrix4d::Zero();
  rows(0, 0) = rows(1, 1) = 1.0;
  Eigen::RowVector4d given;
  given << known.by_logs.transpose(), 1.0;
  if (known.is_stiffness) {
    mode.sensitivity_nm_per_v = std::sqrt(energy / (mode.stiffness_n_per_m * fitted.variance_v2));
    rows.row(2) = given;
    rows.row(3) = -0.5 * given;
    rows(3, 2) -= 0.5;
  } else {
    mode.stiffness_n_per_m =
        energy / (mode.sensitivity_nm_per_v * mode.sensitivity_nm_per_v * fitted.variance_v2);
    rows.row(3) = given;
    rows.row(2) = -2.0 * given;
    rows(2, 2) -= 1.0;
  }
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Zero();
  covariance.topLeftCorner<3, 3>() = measured.covariance;
  covariance(3, 3) = known.relative_error * known.relative_error;
  result.modes.push_back(mode);
  result.uncertainty.push_back(uncertainty_of(mode, rows * covariance * rows.transpose()));
}

// Carried from the first mode, whose statistical error becomes part of what is known.
Known scaled(const Cantilever& first, unsigned from, unsigned to, ModeScaling scaling) {
  const Mode& mode = first.modes.front();
  const Eigen::Matrix4d covariance = log_covariance(mode, first.uncertainty.front());
  if (scaling == ModeScaling::stiffness)
    return {mode.stiffness_n_per_m * beam_stiffness_ratio(to) / beam_stiffness_ratio(from), true,
            Eigen::Vector3d::Zero(), std::sqrt(covariance(2, 2))};
  return {mode.sensitivity_nm_per_v * beam_end_slope(from) / beam_end_slope(to), false,
          Eigen::Vector3d::Zero(), std::sqrt(covariance(3, 3))};
}

}  // namespace

MeasuredMode measured_mode(const ThermalFit& fit, std::size_t mode) {
  const auto first = static_cast<Eigen::Index>(3 * mode);
  return {fit.modes.at(mode), fit.covariance.block<3, 3>(first, first)};
}

Cantilever calibrate_thermal(std::span<const MeasuredMode> modes, const CalibrationSettings& settings) {
  check(modes, settings);
  const auto number = [&](std::size_t m) {
    return settings.mode_numbers.empty() ? static_cast<unsigned>(m + 1) : settings.mode_numbers[m];
  };
  Cantilever result;
  for (std::size_t m = 0; m < modes.size(); ++m) {
    Known known{};
    if (m == 0) {
      known = known_of_first(modes[0], settings);
    } else if (settings.values.size() > 1) {
      known = known_of_first(modes[m], settings);
      known.value = settings.values[m];
    } else {
      known = scaled(result, number(0), number(m), settings.scaling);
    }
    complete(modes[m], known, settings, result);
  }
  return result;
}

}  // namespace combforce

#include "fit/thermal_beam.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace combforce {
namespace {

using Complex = std::complex<double>;

void require_positive(const char* field, double value) {
  if (!(value > 0.0) || !std::isfinite(value))
    throw std::invalid_argument(fmt::format("{}: {}, must be positive and finite", field, value));
}

struct BesselK {
  Complex k0, k1;
};

// Times exp(z): int_0^inf exp(z - z cosh t) cosh(nu t) dt, |arg z| < pi/2, by the trapezoidal rule, whose
// error falls as exp(-2 pi d/step), d the width of the strip in which the integrand decays: pi/4 here.
BesselK scaled_bessel_k(Complex z) {
  constexpr double step = 0.05, negligible = 50.0;
  BesselK sum{0.5, 0.5};
  for (int i = 1;; ++i) {
    const double t = step * i;
    const double growth = std::cosh(t);
    if (z.real() * (growth - 1.0) > negligible + t) break;
    const Complex value = std::exp(z * (1.0 - growth));
    sum.k0 += value;
    sum.k1 += value * growth;
  }
  return {step * sum.k0, step * sum.k1};
}

template <std::size_t Count>
double polynomial(const std::array<double, Count>& coefficients, double x) {
  double value = 0.0;
  for (std::size_t i = Count; i-- > 0;) value = value * x + coefficients[i];
  return value;
}

Complex rectangular_correction(double reynolds) {
  constexpr std::array real_above{0.91324, -0.48274, 0.46842, -0.12886, 0.044055, -0.0035117, 0.00069085};
  constexpr std::array real_below{1.0, -0.56964, 0.48690, -0.13444, 0.045155, -0.0035862, 0.00069085};
  constexpr std::array imag_above{-0.024134, -0.029256, 0.016294, -0.00010961, 0.000064577, -0.000044510};
  constexpr std::array imag_below{1.0, -0.59702, 0.55182, -0.18357, 0.079156, -0.014369, 0.0028361};
  const double x = std::log10(reynolds);
  return {polynomial(real_above, x) / polynomial(real_below, x),
          polynomial(imag_above, x) / polynomial(imag_below, x)};
}

}  // namespace

void validate(const BeamInFluid& beam) {
  require_positive("length_um", beam.length_um);
  require_positive("width_um", beam.width_um);
  require_positive("density_kg_per_m3", beam.density_kg_per_m3);
  require_positive("viscosity_pa_s", beam.viscosity_pa_s);
}

double reynolds_number(const BeamInFluid& beam, double frequency_hz) {
  const double width_m = 1e-6 * beam.width_um;
  return beam.density_kg_per_m3 * 2.0 * std::numbers::pi * frequency_hz * width_m * width_m /
         (4.0 * beam.viscosity_pa_s);
}

std::complex<double> hydrodynamic_function(double reynolds) {
  constexpr double least = 1e-6, most = 1e4;
  if (!(reynolds >= least && reynolds <= most))
    throw std::invalid_argument(
        fmt::format("Reynolds number: {}, must be in [{}, {}], where the hydrodynamic function holds",
                    reynolds, least, most));
  const Complex z = std::polar(std::sqrt(reynolds), -0.25 * std::numbers::pi);  // -i sqrt(i Re)
  const BesselK k = scaled_bessel_k(z);
  return rectangular_correction(reynolds) * (1.0 + 4.0 * k.k1 / (z * k.k0));
}

SaderStiffness sader_stiffness(const BeamInFluid& beam, double frequency_hz, double quality_factor) {
  validate(beam);
  require_positive("frequency_hz", frequency_hz);
  require_positive("quality_factor", quality_factor);
  const double reynolds = reynolds_number(beam, frequency_hz);
  const double drag = hydrodynamic_function(reynolds).imag();
  const double width_m = 1e-6 * beam.width_um;
  const double length_m = 1e-6 * beam.length_um;
  const double omega = 2.0 * std::numbers::pi * frequency_hz;
  const double k = std::numbers::pi / 16.0 * beam.density_kg_per_m3 * width_m * width_m * length_m *
                   quality_factor * omega * omega * drag;
  constexpr double factor = 1.01;  // inwards at the ends of the range
  const double towards = reynolds < 1.0 ? factor : 1.0 / factor;
  const double slope = std::log(hydrodynamic_function(reynolds * towards).imag() / drag) / std::log(towards);
  return {k, 2.0 + slope};
}

double beam_eigenvalue(unsigned mode) {
  if (mode == 0) throw std::invalid_argument("mode: 0, modes count from 1");
  double c = (static_cast<double>(mode) - 0.5) * std::numbers::pi;
  constexpr int enough = 20;
  for (int i = 0; i < enough; ++i) {
    const double value = std::cos(c) + 1.0 / std::cosh(c);
    c -= value / (-std::sin(c) - std::tanh(c) / std::cosh(c));
  }
  return c;
}

double beam_stiffness_ratio(unsigned mode) {
  return std::pow(beam_eigenvalue(mode) / beam_eigenvalue(1), 4);
}

double beam_end_slope(unsigned mode) {
  const double c = beam_eigenvalue(mode);
  return c / (1.0 / std::tanh(c) - 1.0 / std::tan(c));
}

}  // namespace combforce

#include "fit/excitation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "fit/thermal_beam.hpp"

namespace combforce {
namespace {

TEST(Excitation, ParticipationsAreThoseOfABeam) {
  // Textbook values, to their last digit: 4 sigma_m/C_m.
  EXPECT_NEAR(beam_participation(1), 1.566, 5e-4);
  EXPECT_NEAR(beam_participation(2), -0.868, 5e-4);
  EXPECT_NEAR(beam_participation(3), 0.509, 5e-4);
  EXPECT_NEAR(beam_participation(4), -0.364, 5e-4);
  // All modes together carry the whole base motion: at infinite frequency the beam's end stands still.
  double sum = 0.0;
  for (unsigned mode = 1; mode <= 400; ++mode) sum += beam_participation(mode);
  EXPECT_NEAR(sum, 1.0, 2.0 / 400.0);
}

// The whole beam, without its modes: EI w'''' = rho A omega^2 w, clamped to a base that moves by 1, free at
// the end, moves there by (cos b + cosh b)/(1 + cos b cosh b), b^4 = C_1^4 (f/f_1)^2.
double end_motion_of_beam(double frequency_over_first) {
  const double b = beam_eigenvalue(1) * std::sqrt(frequency_over_first);
  return (std::cos(b) + std::cosh(b)) / (1.0 + std::cos(b) * std::cosh(b));
}

TEST(Excitation, TipMovesAsTheEndOfAShakenBeam) {
  Cantilever cantilever;
  for (unsigned m = 1; m <= 12; ++m) {
    const double ratio = std::pow(beam_eigenvalue(m) / beam_eigenvalue(1), 2);
    cantilever.modes.push_back({100e3 * ratio, 1e7, 4.0 * beam_stiffness_ratio(m), 1.0});
  }
  const Excitation excitation{Excitation::Kind::base, {}};
  for (const double frequency_over_first : {0.3, 0.97, 1.02, 3.0, 6.2, 6.35}) {
    const double end = end_motion_of_beam(frequency_over_first);
    const std::vector<double> frequencies_hz{100e3 * frequency_over_first};
    const std::vector<std::complex<double>> apparent{end - 1.0};  // alike sensitivities: the deflection
    const auto beside = motion_beside_deflection(excitation, cantilever, frequencies_hz, apparent);
    // The modes left out and the damping are worth some 1e-4 of the base.
    EXPECT_NEAR(beside[0].real(), 1.0, 2e-3) << frequency_over_first;
    EXPECT_NEAR(beside[0].imag(), 0.0, 2e-3) << frequency_over_first;
  }
}

TEST(Excitation, DetectsTheDrivenModeByItsOwnSensitivity) {
  // At resonance the driven mode is all but alone: d_free = alpha_m V_free + base.
  const Cantilever cantilever{{{117e3, 212, 4, 20}, {674e3, 457, 78.5, -7}, {1758e3, 507, 366, 3}}};
  const std::vector<double> frequencies_hz{117e3, 674e3, 1758e3};
  const std::complex<double> volts(0.3, -0.4);
  std::vector<std::complex<double>> apparent;
  for (const double frequency_hz : frequencies_hz)
    apparent.push_back(tip_per_volt(cantilever, frequency_hz) * volts);
  const auto beside =
      motion_beside_deflection({Excitation::Kind::base, {}}, cantilever, frequencies_hz, apparent);
  for (std::size_t m = 0; m < 3; ++m) {
    const std::complex<double> own = cantilever.modes[m].sensitivity_nm_per_v * volts;
    // The base, and what the other modes add, are of the order of own/(Q Gamma).
    EXPECT_LT(std::abs(apparent[m] + beside[m] - own), 0.03 * std::abs(own)) << m;
  }
  for (const std::complex<double> tone :
       motion_beside_deflection(Excitation{}, cantilever, frequencies_hz, apparent))
    EXPECT_EQ(tone, 0.0);
}

TEST(Excitation, RefusesParticipationsThatItCannotUse) {
  const Cantilever cantilever{{{117e3, 212, 4, 1}}};
  const double nan = std::nan("");
  EXPECT_NO_THROW(validate(Excitation{Excitation::Kind::base, {1.5}}, cantilever));
  for (const Excitation& bad :
       {Excitation{Excitation::Kind::tip, {1.5}}, Excitation{Excitation::Kind::base, {1.5, 0.8}},
        Excitation{Excitation::Kind::base, {0.0}}, Excitation{Excitation::Kind::base, {nan}}})
    EXPECT_THROW(validate(bad, cantilever), std::invalid_argument);
}

}  // namespace
}  // namespace combforce

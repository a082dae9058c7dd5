#include "fit/excitation.hpp"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "fit/thermal_beam.hpp"

namespace combforce {
namespace {

double participation_of(const Excitation& excitation, std::size_t mode) {
  return excitation.participation.empty() ? beam_participation(static_cast<unsigned>(mode + 1))
                                          : excitation.participation[mode];
}

// Of unit base motion.
struct Answer {
  std::complex<double> tip, volts;
};
Answer answer_to_base(const Excitation& excitation, const Cantilever& cantilever, double frequency_hz) {
  Answer answer{1.0, 0.0};
  for (std::size_t m = 0; m < cantilever.modes.size(); ++m) {
    const Mode& mode = cantilever.modes[m];
    const double ratio = frequency_hz / mode.frequency_hz;
    const std::complex<double> deflection = participation_of(excitation, m) * ratio * ratio *
                                            mode.stiffness_n_per_m * mode_response(mode, frequency_hz);
    answer.tip += deflection;
    answer.volts += deflection / mode.sensitivity_nm_per_v;
  }
  return answer;
}

}  // namespace

void validate(const Excitation& excitation, const Cantilever& cantilever) {
  if (excitation.participation.empty()) return;
  if (excitation.kind != Excitation::Kind::base)
    throw std::invalid_argument("excitation.participation: belongs to base excitation alone");
  if (excitation.participation.size() != cantilever.modes.size())
    throw std::invalid_argument(fmt::format("excitation.participation: {} values, must be {}, one a mode",
                                            excitation.participation.size(), cantilever.modes.size()));
  for (std::size_t m = 0; m < excitation.participation.size(); ++m)
    if (excitation.participation[m] == 0.0 || !std::isfinite(excitation.participation[m]))
      throw std::invalid_argument(fmt::format("excitation.participation[{}]: {}, must be finite and not zero",
                                              m, excitation.participation[m]));
}

double beam_participation(unsigned mode) {
  const double c = beam_eigenvalue(mode);
  // sigma, with numerator and denominator over exp(c), which overflows.
  const double decay = std::exp(-c);
  const double sigma =
      (0.5 - 0.5 * decay * decay - decay * std::sin(c)) / (0.5 + 0.5 * decay * decay + decay * std::cos(c));
  return (mode % 2 == 1 ? 4.0 : -4.0) * sigma / c;
}

std::vector<std::complex<double>> motion_beside_deflection(
    const Excitation& excitation, const Cantilever& cantilever, std::span<const double> frequencies_hz,
    std::span<const std::complex<double>> apparent_nm) {
  std::vector<std::complex<double>> beside(frequencies_hz.size());
  if (excitation.kind == Excitation::Kind::tip) return beside;
  for (std::size_t i = 0; i < beside.size(); ++i) {
    const Answer answer = answer_to_base(excitation, cantilever, frequencies_hz[i]);
    const std::complex<double> volts = apparent_nm[i] / tip_per_volt(cantilever, frequencies_hz[i]);
    beside[i] = volts * answer.tip / answer.volts - apparent_nm[i];
  }
  return beside;
}

}  // namespace combforce

#include "daemon/cli/paper/simulator_check.hpp"

#include <algorithm>
#include <cmath>

#include "dsp/fourier.hpp"

namespace combforce::paper {
namespace {

using Complex = std::complex<double>;

// Equation 7 on every bin.
std::vector<Complex> recovered_force(const CaseMotion& motion, std::span<const double> tip_nm) {
  std::vector<Complex> force = spectrum_of(tip_nm);
  for (std::size_t i = 0; i < motion.of->bins.size(); ++i) force[motion.of->bins[i]] -= motion.free_nm[i];
  for (std::size_t k = 0; k < force.size(); ++k)
    force[k] /= tip_response(cantilever(), delta_f_hz * static_cast<double>(k));
  return force;
}

std::vector<double> used_force(const Case& of, std::span<const double> tip_nm) {
  const ModelInfo& model = find_model(of.model);
  std::vector<double> force;
  force.reserve(tip_nm.size());
  for (const double d : tip_nm) force.push_back(model_force(model, of.truth, d));
  return force;
}

Difference difference_of(std::span<const double> errors) {
  double sum = 0.0, squares = 0.0;
  Difference result;
  for (const double error : errors) {
    result.largest_nn = std::max(result.largest_nn, std::abs(error));
    sum += error;
    squares += error * error;
  }
  const auto samples = static_cast<double>(errors.size());
  result.spread_nn = std::sqrt(std::max(0.0, squares / samples - sum * sum / (samples * samples)));
  return result;
}

std::vector<double> minus(std::span<const double> a, std::span<const double> b) {
  std::vector<double> result(a.size());
  std::ranges::transform(a, b, result.begin(), std::minus<>{});
  return result;
}

std::vector<double> every(std::uint64_t step, std::span<const double> signal) {
  std::vector<double> result;
  for (std::size_t n = 0; n < signal.size(); n += step) result.push_back(signal[n]);
  return result;
}

}  // namespace

SimulatorCheck check_simulator(const CaseMotion& motion) {
  const std::vector<double>& tip_nm = motion.engaged.tip_motion_nm;
  SimulatorCheck check{
      motion.of, signal_of(recovered_force(motion, tip_nm)), used_force(*motion.of, tip_nm), {}};
  check.difference = difference_of(minus(check.recovered_nn, check.used_nn));
  return check;
}

BandCheck check_band(const Case& of) {
  constexpr std::uint64_t finest = 8;
  const CaseMotion motion = simulate(of, finest);
  const std::vector<double>& tip_nm = motion.engaged.tip_motion_nm;
  BandCheck check;
  check.of = &of;
  for (std::uint64_t rate = 1; rate <= finest; rate *= 2) {
    const std::vector<double> sampled = every(finest / rate, tip_nm);
    const std::vector<double> recovered = signal_of(recovered_force(motion, sampled));
    check.rates.push_back({sample_rate_hz * static_cast<double>(rate),
                           difference_of(minus(recovered, used_force(of, sampled)))});
  }
  std::vector<Complex> error = recovered_force(motion, tip_nm);
  const std::vector<Complex> used = spectrum_of(used_force(of, tip_nm));
  for (std::size_t k = 0; k < error.size(); ++k) error[k] -= used[k];
  error.resize(window_samples / 2 + 1);
  error.back() = 0.0;
  check.in_band_error_nn = signal_of(error);
  check.in_band = difference_of(check.in_band_error_nn);
  return check;
}

}  // namespace combforce::paper

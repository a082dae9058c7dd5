#include "daemon/cli/paper/simulator_check.hpp"

#include <algorithm>
#include <cmath>

#include "daemon/cli/paper/fourier.hpp"

namespace combforce::paper {

SimulatorCheck check_simulator(const CaseMotion& motion) {
  const Case& of = *motion.of;
  SimulatorCheck check;
  check.of = &of;
  std::vector<std::complex<double>> force = spectrum(motion.engaged.tip_motion_nm);
  for (std::size_t i = 0; i < of.bins.size(); ++i) force[of.bins[i]] -= motion.free_nm[i];
  for (std::size_t k = 0; k < force.size(); ++k)
    force[k] /= tip_response(cantilever(), delta_f_hz * static_cast<double>(k));
  check.recovered_nn = signal(force);

  const ModelInfo& model = find_model(of.model);
  double sum = 0.0, squares = 0.0;
  for (std::size_t i = 0; i < check.recovered_nn.size(); ++i) {
    check.used_nn.push_back(model_force(model, of.truth, motion.engaged.tip_motion_nm[i]));
    const double difference = check.recovered_nn[i] - check.used_nn[i];
    check.largest_nn = std::max(check.largest_nn, std::abs(difference));
    sum += difference;
    squares += difference * difference;
  }
  const auto samples = static_cast<double>(check.recovered_nn.size());
  check.spread_nn = std::sqrt(std::max(0.0, squares / samples - sum * sum / (samples * samples)));
  return check;
}

}  // namespace combforce::paper

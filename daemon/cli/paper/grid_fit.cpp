#include "daemon/cli/paper/grid_fit.hpp"

#include <ceres/jet.h>

#include <Eigen/Dense>
#include <array>
#include <numeric>

#include "dsp/comb.hpp"
#include "fit/model_list.hpp"

namespace combforce::paper {
namespace {

using Complex = std::complex<double>;

struct Grid {
  std::vector<double> d_nm;                // one a sample of a period
  std::vector<std::vector<Complex>> turn;  // [tone][sample]: exp(-i w t) 2/samples
  Eigen::VectorXd measured_nn;             // (re, im) of each tone
};

Grid make_grid(const CaseMotion& motion, std::span<const Complex> tip_nm) {
  std::uint64_t periods = window_samples;
  for (const std::uint64_t bin : motion.of->bins) periods = std::gcd(periods, bin);
  const std::uint64_t samples = window_samples / periods;
  const std::size_t tones = motion.of->bins.size();
  Grid grid{std::vector<double>(samples), {}, Eigen::VectorXd(static_cast<Eigen::Index>(2 * tones))};
  for (std::size_t i = 0; i < tones; ++i) {
    const std::uint64_t bin = motion.of->bins[i];
    const Complex tone = tip_nm[i];
    std::vector<Complex>& turn = grid.turn.emplace_back(samples);
    for (std::uint64_t n = 0; n < samples; ++n) {
      const double phase = phase_radians(phase_index(bin, n, window_samples), window_samples);
      turn[n] = std::polar(2.0 / static_cast<double>(samples), -phase);
      grid.d_nm[n] += (tone * std::polar(1.0, phase)).real();
    }
    const Complex force =
        (tone - motion.free_nm[i]) / tip_response(cantilever(), delta_f_hz * static_cast<double>(bin));
    grid.measured_nn(static_cast<Eigen::Index>(2 * i)) = force.real();
    grid.measured_nn(static_cast<Eigen::Index>(2 * i + 1)) = force.imag();
  }
  return grid;
}

template <typename Model>
struct Linearization {
  Eigen::VectorXd residuals;
  Eigen::Matrix<double, Eigen::Dynamic, Model::parameters> jacobian;
};

template <typename Model>
Linearization<Model> linearize(const Grid& grid, const Eigen::Matrix<double, Model::parameters, 1>& p) {
  Linearization<Model> at{-grid.measured_nn, {}};
  at.jacobian.setZero(grid.measured_nn.size(), Model::parameters);
  using Jet = ceres::Jet<double, Model::parameters>;
  std::array<Jet, Model::parameters> jets;
  for (std::size_t k = 0; k < Model::parameters; ++k)
    jets[k] = Jet(p(static_cast<Eigen::Index>(k)), static_cast<int>(k));
  for (std::size_t n = 0; n < grid.d_nm.size(); ++n) {
    const Jet value = Model::force(jets.data(), Jet(grid.d_nm[n]));
    const double force = value.a;
    const auto& gradient = value.v;
    if (force == 0.0) continue;
    for (std::size_t i = 0; i < grid.turn.size(); ++i) {
      const auto row = static_cast<Eigen::Index>(2 * i);
      const Complex turn = grid.turn[i][n];
      at.residuals(row) += force * turn.real();
      at.residuals(row + 1) += force * turn.imag();
      for (std::size_t k = 0; k < Model::parameters; ++k) {
        at.jacobian(row, static_cast<Eigen::Index>(k)) +=
            gradient(static_cast<Eigen::Index>(k)) * turn.real();
        at.jacobian(row + 1, static_cast<Eigen::Index>(k)) +=
            gradient(static_cast<Eigen::Index>(k)) * turn.imag();
      }
    }
  }
  return at;
}

template <typename Model>
GridFit solve(const Grid& grid, std::span<const double> start) {
  using Vector = Eigen::Matrix<double, Model::parameters, 1>;
  using Matrix = Eigen::Matrix<double, Model::parameters, Model::parameters>;
  Vector p = Eigen::Map<const Vector>(start.data());
  Linearization<Model> at = linearize<Model>(grid, p);
  double damping = 1e-4;
  bool converged = false;
  for (int iteration = 0; iteration < 200 && damping < 1e12; ++iteration) {
    const Matrix normal = at.jacobian.transpose() * at.jacobian;
    const Matrix damped = normal + damping * Matrix(normal.diagonal().asDiagonal());
    const Vector step = -damped.ldlt().solve(at.jacobian.transpose() * at.residuals);
    converged = step.norm() < 1e-9 * p.norm();
    if (converged) break;
    const Vector next = p + step;
    Linearization<Model> there = linearize<Model>(grid, next);
    if (there.residuals.squaredNorm() < at.residuals.squaredNorm()) {
      p = next;
      at = std::move(there);
      damping *= 0.2;
      continue;
    }
    damping *= 5.0;
  }
  return {converged, {p.data(), p.data() + p.size()}};
}

}  // namespace

GridFit fit_on_grid(const CaseMotion& motion, std::span<const Complex> tip_nm,
                    std::span<const double> start) {
  const Grid grid = make_grid(motion, tip_nm);
  return visit_model(find_model(motion.of->model),
                     [&](auto model) { return solve<decltype(model)>(grid, start); });
}

}  // namespace combforce::paper

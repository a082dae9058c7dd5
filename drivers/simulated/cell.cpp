#include "drivers/simulated/cell.hpp"

#include <fmt/format.h>

#include <boost/math/quadrature/gauss.hpp>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace combforce {

using Complex = std::complex<double>;

namespace {

const double inner_node = std::sqrt(3.0 / 7.0);

// Lagrange polynomial of node l at s in [0, 1].
double lagrange(std::size_t l, double s) {
  double product = 1.0;
  for (std::size_t j = 0; j < cell_nodes; ++j) {
    if (j != l) product *= (s - cell_node[j]) / (cell_node[l] - cell_node[j]);
  }
  return product;
}

// Integral over [0, end] of exp(lambda (end - s)) times the Lagrange polynomial of node l on a cell of
// `length`. The phase turned over a cell is a few radians at most: 20 Gauss nodes integrate it to rounding.
Complex response_integral(Complex lambda, double end, double length, std::size_t l) {
  const auto integrand = [&](double s) { return std::exp(lambda * (end - s)) * lagrange(l, s / length); };
  using Gauss = boost::math::quadrature::gauss<double, 20>;
  const auto real = [&](double s) { return integrand(s).real(); };
  const auto imag = [&](double s) { return integrand(s).imag(); };
  return {Gauss::integrate(real, 0.0, end), Gauss::integrate(imag, 0.0, end)};
}

}  // namespace

const std::array<double, cell_nodes> cell_node{0.0, 0.5 * (1.0 - inner_node), 0.5, 0.5 * (1.0 + inner_node),
                                               1.0};

ModeDynamics mode_dynamics(const Mode& mode) {
  if (!(mode.quality_factor > 0.5)) {
    throw std::invalid_argument(
        fmt::format("cantilever mode at {} Hz: quality_factor is {}, must be > 0.5 "
                    "in a simulation",
                    mode.frequency_hz, mode.quality_factor));
  }
  const double omega = 2.0 * std::numbers::pi * mode.frequency_hz;
  const double decay = omega / (2.0 * mode.quality_factor);
  const double ringing = std::sqrt(omega * omega - decay * decay);
  return {{-decay, ringing}, {0.0, -omega * omega / (mode.stiffness_n_per_m * ringing)}};
}

CellTable::CellTable(const StateDynamics& dynamics, double cell_seconds) : seconds(cell_seconds) {
  force_re.resize(dynamics.modes());
  force_im.resize(dynamics.modes());
  for (const Complex& lambda : dynamics.lambda) {
    const Complex propagator = std::exp(lambda * seconds);
    propagate_re.push_back(propagator.real());
    propagate_im.push_back(propagator.imag());
  }
  for (std::size_t l = 0; l < cell_nodes; ++l) {
    for (std::size_t m = 0; m < dynamics.modes(); ++m) {
      const Complex lambda = dynamics.lambda[dynamics.tones() + m];
      const Complex effect = dynamics.coupling[m] * response_integral(lambda, seconds, seconds, l);
      force_re[m][l] = effect.real();
      force_im[m][l] = effect.imag();
      for (std::size_t j = 1; j < cell_nodes; ++j) {
        const double at_node =
            (dynamics.coupling[m] * response_integral(lambda, cell_node[j] * seconds, seconds, l)).real();
        tip_per_force[l][j - 1] += at_node;
        tip_per_steady_force[j - 1] += at_node;
      }
    }
  }
  for (const double shift : tip_per_steady_force) {
    greatest_tip_per_force = std::max(greatest_tip_per_force, std::abs(shift));
  }
  set_weights(dynamics);
}

void CellTable::set_weights(const StateDynamics& dynamics) {
  tip_re.resize(dynamics.states());
  tip_im.resize(dynamics.states());
  for (std::size_t n = 0; n < dynamics.states(); ++n) {
    for (std::size_t j = 1; j < cell_nodes; ++j) {
      const Complex moved = dynamics.weight[n] * std::exp(dynamics.lambda[n] * (cell_node[j] * seconds));
      tip_re[n][j - 1] = moved.real();
      tip_im[n][j - 1] = -moved.imag();
    }
  }
}

ShortCell::ShortCell(const StateDynamics& dynamics) {
  using Gauss = boost::math::quadrature::gauss<double, 7>;  // exact to degree 13
  for (std::size_t l = 0; l < cell_nodes; ++l) {
    double factorial = 1.0;
    for (std::size_t k = 0; k < moments; ++k) {
      if (k > 0) factorial *= static_cast<double>(k);
      const auto integrand = [&](double s) {
        return std::pow(1.0 - s, static_cast<double>(k)) / factorial * lagrange(l, s);
      };
      moment[k][l] = Gauss::integrate(integrand, 0.0, 1.0);
    }
    for (std::size_t j = 1; j < cell_nodes; ++j) {
      const auto integrand = [&](double s) { return (cell_node[j] - s) * lagrange(l, s); };
      tip_per_force[l][j - 1] = Gauss::integrate(integrand, 0.0, cell_node[j]);
    }
  }
  for (std::size_t m = 0; m < dynamics.modes(); ++m) {
    acceleration += (dynamics.coupling[m] * dynamics.lambda[dynamics.tones() + m]).real();
  }
  set_weights(dynamics);
}

void ShortCell::set_weights(const StateDynamics& dynamics) {
  for (std::size_t k = 0; k <= order; ++k) {
    taylor_re[k].resize(dynamics.states());
    taylor_im[k].resize(dynamics.states());
  }
  for (std::size_t n = 0; n < dynamics.states(); ++n) {
    Complex term = dynamics.weight[n];
    for (std::size_t k = 0; k <= order; ++k) {
      taylor_re[k][n] = term.real();
      taylor_im[k][n] = -term.imag();
      term *= dynamics.lambda[n] / static_cast<double>(k + 1);
    }
  }
}

}  // namespace combforce

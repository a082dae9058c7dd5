// How the residuals of a force balance are made comparable before they are squared.
#pragma once

#include <Eigen/Core>
#include <span>

#include "fit/measured_force.hpp"

namespace combforce {

// Rows and columns are (re, im) of every tone.
struct Whitening {
  Eigen::MatrixXd root;        // lower triangular L: L^-1 r is squared
  Eigen::MatrixXd covariance;  // of L^-1 r by the noise model: the identity when by_noise, 0 without one
  bool by_noise = false;       // L L' is the covariance of the measured forces
};

// By the noise where it is known and reaches every tone, otherwise by these weights of squares, one a tone.
Whitening whitening(const MeasuredForce& measured, std::span<const double> weights);

}  // namespace combforce

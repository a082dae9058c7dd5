#include "fit/whitening.hpp"

#include <Eigen/Cholesky>
#include <cmath>

namespace combforce {

Whitening whitening(const MeasuredForce& measured, std::span<const double> weights) {
  const Eigen::MatrixXd& covariance = measured.covariance();
  const Eigen::Index rows = covariance.rows();
  if (measured.noise_known()) {
    const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
    if (factor.info() == Eigen::Success)
      return {factor.matrixL(), Eigen::MatrixXd::Identity(rows, rows), true};
  }
  Whitening result{Eigen::MatrixXd::Zero(rows, rows), covariance, false};
  for (Eigen::Index i = 0; i < rows; ++i)
    result.root(i, i) = 1.0 / std::sqrt(weights[static_cast<std::size_t>(i / 2)]);
  for (Eigen::Index i = 0; i < rows; ++i)
    for (Eigen::Index j = 0; j < rows; ++j) result.covariance(i, j) /= result.root(i, i) * result.root(j, j);
  return result;
}

}  // namespace combforce

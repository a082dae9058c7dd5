// The minimum of the paper's E by ceres::Solve with a cost function of its own: the reference's quadrature,
// all parameters at once, no starts, no elimination, no scaling of fit/.
#pragma once

#include <ceres/ceres.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "tests/unit/fit/reference_force.hpp"

namespace combforce::test {

// Residuals sqrt(w_i) (F_i(p) - F_i), rows (re, im) of each tone.
template <typename Model>
class ReferenceCost : public ceres::SizedCostFunction<ceres::DYNAMIC, static_cast<int>(Model::parameters)> {
 public:
  ReferenceCost(const ReferenceMotion& motion, std::vector<std::complex<double>> forces,
                std::vector<double> weights)
      : motion_(motion), forces_(std::move(forces)), weights_(std::move(weights)) {
    this->set_num_residuals(static_cast<int>(2 * forces_.size()));
  }

  bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override {
    // Of a strength of one; Kronrod's sum is far better than its difference from Gauss's.
    const double tolerance = 1e-6 * std::max(1.0, parameters[0][1]);
    Eigen::MatrixXd sum = reference_force<Model>(motion_, {parameters[0], Model::parameters}, tolerance);
    for (std::size_t i = 0; i < forces_.size(); ++i) {
      const auto row = static_cast<Eigen::Index>(2 * i);
      sum(row, 0) -= forces_[i].real();
      sum(row + 1, 0) -= forces_[i].imag();
      sum.middleRows<2>(row) *= std::sqrt(weights_[i]);
    }
    Eigen::Map<Eigen::VectorXd>(residuals, sum.rows()) = sum.col(0);
    if (jacobians != nullptr && jacobians[0] != nullptr)
      Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Model::parameters, Eigen::RowMajor>>(
          jacobians[0], sum.rows(), Model::parameters) = sum.rightCols<Model::parameters>();
    return true;
  }

 private:
  const ReferenceMotion& motion_;
  std::vector<std::complex<double>> forces_;
  std::vector<double> weights_;
};

struct Minimum {
  std::vector<double> parameters;
  double error = std::numeric_limits<double>::infinity();  // weighted E
};

// From `p`; parameters but the first stay positive, those listed in `held` stay where they are.
template <typename Model>
Minimum solve_by_ceres(const ReferenceMotion& motion, const std::vector<std::complex<double>>& forces,
                       const std::vector<double>& weights, std::vector<double> p,
                       const std::vector<int>& held = {}) {
  ceres::Problem problem;
  problem.AddResidualBlock(new ReferenceCost<Model>(motion, forces, weights), nullptr, p.data());
  for (int k = 1; k < static_cast<int>(Model::parameters); ++k)
    problem.SetParameterLowerBound(p.data(), k, 1e-3);
  if (!held.empty())
    problem.SetManifold(p.data(), new ceres::SubsetManifold(static_cast<int>(Model::parameters), held));
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.logging_type = ceres::SILENT;
  options.max_num_iterations = 100;
  options.function_tolerance = 1e-13;
  options.gradient_tolerance = 1e-13;
  options.parameter_tolerance = 1e-10;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return {p, 2.0 * summary.final_cost};
}

}  // namespace combforce::test

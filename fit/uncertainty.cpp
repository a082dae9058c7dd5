#include "fit/uncertainty.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>

namespace combforce {
namespace {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
constexpr int most = static_cast<int>(max_parameters);
using Small = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, most, most>;
using SmallVector = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, most, 1>;

// J'WJ scaled to a unit diagonal; rows and columns of fixed or unfelt parameters are those of the identity.
struct Normal {
  Small matrix;
  SmallVector scale;  // of the parameters: 1/|sqrt(W) J column|, 0 for fixed ones
  Eigen::LDLT<Small> factor;
  bool regular = true;
};

// sum over rows of w a b.
double inner(const Linearization& at, Eigen::Index k, Eigen::Index l) {
  double sum = 0.0;
  for (Eigen::Index row = 0; row < at.jacobian.rows(); ++row)
    sum += at.weights[static_cast<std::size_t>(row / 2)] * at.jacobian(row, k) * at.jacobian(row, l);
  return sum;
}

Normal normal_equations(const Linearization& at) {
  const Eigen::Index count = at.jacobian.cols();
  Normal normal;
  normal.matrix = Small::Identity(count, count);
  normal.scale = SmallVector::Zero(count);
  for (Eigen::Index k = 0; k < count; ++k) {
    if (at.fixed[static_cast<std::size_t>(k)]) continue;
    const double square = inner(at, k, k);
    if (square > 0.0 && std::isfinite(square))
      normal.scale(k) = 1.0 / std::sqrt(square);
    else
      normal.regular = false;
  }
  for (Eigen::Index k = 0; k < count; ++k)
    for (Eigen::Index l = 0; l < k; ++l) {
      const double scale = normal.scale(k) * normal.scale(l);
      normal.matrix(k, l) = normal.matrix(l, k) = scale > 0.0 ? scale * inner(at, k, l) : 0.0;
    }
  normal.factor.compute(normal.matrix);
  const Eigen::SelfAdjointEigenSolver<Small> eigen(normal.matrix, Eigen::EigenvaluesOnly);
  const auto& values = eigen.eigenvalues();
  if (!(values.minCoeff() > 1e-12 * values.maxCoeff())) normal.regular = false;
  return normal;
}

}  // namespace

std::array<double, max_parameters> minimum_shift(const Linearization& at,
                                                 const Eigen::Ref<const Eigen::VectorXd>& shift) {
  const Normal normal = normal_equations(at);
  SmallVector right = SmallVector::Zero(at.jacobian.cols());
  for (Eigen::Index k = 0; k < right.size(); ++k)
    for (Eigen::Index row = 0; row < shift.size(); ++row)
      right(k) -=
          at.weights[static_cast<std::size_t>(row / 2)] * at.jacobian(row, k) * normal.scale(k) * shift(row);
  const SmallVector moved = normal.factor.solve(right);
  std::array<double, max_parameters> result;
  result.fill(unknown);
  if (normal.regular)
    for (Eigen::Index k = 0; k < right.size(); ++k)
      result[static_cast<std::size_t>(k)] = normal.scale(k) * moved(k);
  return result;
}

bool estimate_uncertainty(const Linearization& at, const Eigen::Ref<const Eigen::MatrixXd>& covariance,
                          double chi2, bool noise_known, FitResult& result) {
  const Normal normal = normal_equations(at);
  const Eigen::Index count = at.jacobian.cols(), rows = at.jacobian.rows();
  result.free_parameters = static_cast<std::uint32_t>((normal.scale.array() > 0.0).count());
  if (rows > result.free_parameters && std::isfinite(chi2))
    result.chi2_reduced = chi2 / static_cast<double>(rows - result.free_parameters);
  if (!noise_known || !normal.regular) return normal.regular;
  const auto weighted = [&](Eigen::Index row, Eigen::Index k) {
    return at.weights[static_cast<std::size_t>(row / 2)] * at.jacobian(row, k) * normal.scale(k);
  };
  Small meat = Small::Zero(count, count);
  for (Eigen::Index i = 0; i < rows; ++i)
    for (Eigen::Index j = 0; j < rows; ++j) {
      if (covariance(i, j) == 0.0) continue;
      for (Eigen::Index k = 0; k < count; ++k)
        for (Eigen::Index l = 0; l < count; ++l)
          meat(k, l) += weighted(i, k) * covariance(i, j) * weighted(j, l);
    }
  const Small inverse = normal.factor.solve(Small::Identity(count, count));
  const Small of_parameters = inverse * meat * inverse;
  for (Eigen::Index k = 0; k < count; ++k) {
    if (normal.scale(k) == 0.0) continue;
    result.std_errors[static_cast<std::size_t>(k)] = normal.scale(k) * std::sqrt(of_parameters(k, k));
  }
  std::size_t pair = 0;
  for (Eigen::Index k = 0; k < count; ++k)
    for (Eigen::Index l = k + 1; l < count; ++l, ++pair)
      if (normal.scale(k) > 0.0 && normal.scale(l) > 0.0)
        result.correlation[pair] = of_parameters(k, l) / std::sqrt(of_parameters(k, k) * of_parameters(l, l));
  return true;
}

}  // namespace combforce

// Where a fit begins. The minimum of the paper's E lies in a curved trench, and a solver that starts at a
// guess finds another one in a case out of six. The motion itself says where to look: the surface is near its
// lower turning point.
//
// A histogram of d over the period, with the phases of the tones as weights, gives model phasors at the cost
// of its bins, to a percent or so. On it p0 is scanned over depths below … above the turning point and over
// the model's shapes; the linear parameters follow by least squares, held at 0 or above. The best few minima
// of the scan are the starts.
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <complex>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include "fit/motion.hpp"

namespace combforce {

// Thread-bound. Only the constructor allocates.
class StartValues {
 public:
  static constexpr std::size_t depths = 20;
  static constexpr std::size_t most = 3;  // starts

  explicit StartValues(std::size_t tones);

  // The histogram of a motion.
  void set_motion(const Motion& motion);

  // Writes up to `most` starts, best first, each with every parameter of the model; returns how many.
  // `forces`: measured phasors, one a tone; `weights`: of their squares in the error to be minimised.
  template <typename Model>
  std::size_t scan(std::span<const std::complex<double>> forces, std::span<const double> weights,
                   std::span<std::array<double, Model::parameters>, most> starts);

 private:
  static constexpr std::size_t bins = 640;

  template <typename Model>
  struct Candidate {
    std::array<double, Model::parameters> p;
    double error = std::numeric_limits<double>::infinity();
  };

  double depth(std::size_t index) const;
  template <typename Model>
  Candidate<Model> candidate(const std::array<double, Model::parameters>& shape, double p0,
                             std::span<const std::complex<double>> forces, std::span<const double> weights);

  double lowest_ = 0.0, span_ = 0.0;
  std::vector<double> d_;      // of the bins: spaced as their index squared, closest at the turning point
  Eigen::MatrixXd histogram_;  // (re, im a tone) x bins
  Eigen::MatrixXd basis_;      // (re, im a tone) x parameters
  std::vector<std::complex<double>> phases_, node_;
};

// With f the measured forces and B the model's phasors a unit of each linear parameter, minimises |W(B a -
// f)|^2 over a >= 0 by trying every set of parameters that are not 0.
template <typename Model>
StartValues::Candidate<Model> StartValues::candidate(const std::array<double, Model::parameters>& shape,
                                                     double p0, std::span<const std::complex<double>> forces,
                                                     std::span<const double> weights) {
  constexpr std::size_t unknowns = Model::linear.size();
  using Matrix = Eigen::Matrix<double, unknowns, unknowns>;
  using Vector = Eigen::Matrix<double, unknowns, 1>;
  std::array<double, Model::parameters> p = shape;
  p[0] = p0;
  basis_.setZero();
  for (std::size_t bin = 0; bin < bins; ++bin) {
    if (!Model::has_tail && d_[bin] > p0) break;
    std::array<double, Model::parameters> gradient;
    Model::derivatives(p.data(), d_[bin], gradient.data());
    for (std::size_t k = 0; k < unknowns; ++k)
      basis_.col(static_cast<Eigen::Index>(k)) +=
          gradient[Model::linear[k]] * histogram_.col(static_cast<Eigen::Index>(bin));
  }
  Matrix normal = Matrix::Zero();
  Vector right = Vector::Zero();
  double constant = 0.0;
  for (std::size_t i = 0; i < 2 * forces.size(); ++i) {
    const double weight = weights[i / 2], force = i % 2 == 0 ? forces[i / 2].real() : forces[i / 2].imag();
    constant += weight * force * force;
    for (std::size_t k = 0; k < unknowns; ++k) {
      const double b = basis_(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k));
      right(static_cast<Eigen::Index>(k)) += weight * b * force;
      for (std::size_t l = 0; l < unknowns; ++l)
        normal(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(l)) +=
            weight * b * basis_(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(l));
    }
  }
  Candidate<Model> best{p, constant};
  for (std::size_t k : Model::linear) best.p[k] = 0.0;
  for (unsigned set = 1; set < 1u << unknowns; ++set) {
    Matrix a = Matrix::Identity();
    Vector b = Vector::Zero();
    for (Eigen::Index k = 0; k < a.rows(); ++k) {
      if ((set >> k & 1u) == 0) continue;
      b(k) = right(k);
      for (Eigen::Index l = 0; l < a.cols(); ++l)
        if ((set >> l & 1u) != 0) a(k, l) = normal(k, l);
    }
    const Vector x = a.fullPivLu().solve(b);
    const double error = constant - 2.0 * right.dot(x) + x.dot(normal * x);
    if (!(error < best.error) || !(x.minCoeff() >= 0.0)) continue;
    best.error = error;
    for (std::size_t k = 0; k < unknowns; ++k) best.p[Model::linear[k]] = x(static_cast<Eigen::Index>(k));
  }
  return best;
}

template <typename Model>
std::size_t StartValues::scan(std::span<const std::complex<double>> forces, std::span<const double> weights,
                              std::span<std::array<double, Model::parameters>, most> starts) {
  std::array<Candidate<Model>, most> best;
  const auto offer = [&best](const Candidate<Model>& one) {
    auto place = std::ranges::find_if(best, [&](const auto& other) { return one.error < other.error; });
    if (place == best.end()) return;
    std::move_backward(place, best.end() - 1, best.end());
    *place = one;
  };
  for (const auto& shape : Model::shapes) {
    std::array<Candidate<Model>, depths> row;
    for (std::size_t i = 0; i < depths; ++i)
      row[i] = candidate<Model>(shape, lowest_ + depth(i), forces, weights);
    for (std::size_t i = 0; i < depths; ++i) {
      const bool below_left = i == 0 || row[i].error <= row[i - 1].error;
      const bool below_right = i + 1 == depths || row[i].error < row[i + 1].error;
      if (below_left && below_right) offer(row[i]);
    }
  }
  std::size_t count = 0;
  for (const auto& one : best)
    if (one.error < std::numeric_limits<double>::infinity()) starts[count++] = one.p;
  return count;
}

}  // namespace combforce

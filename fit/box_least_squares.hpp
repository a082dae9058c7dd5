// Linear least squares for a few unknowns between bounds.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

namespace combforce {

struct Bounds {
  double lower, upper;
};

enum class Hold : std::uint8_t { free, lower, upper };

template <std::size_t Unknowns>
struct BoxSolution {
  Eigen::Matrix<double, Unknowns, 1> x;
  std::array<Hold, Unknowns> holds{};
  double value = std::numeric_limits<double>::infinity();  // x'Nx - 2 b'x
};

// Minimises x'Nx - 2 b'x, N = A'A and b = A'y of |Ax - y|^2, within the bounds: tries every combination of
// unknowns free, at the lower, and at the upper bound, all free first (3^Unknowns at most). An unknown that A
// does not feel (N_kk = 0) is held at its lower bound. Does not allocate.
template <std::size_t Unknowns>
BoxSolution<Unknowns> solve_box(const Eigen::Matrix<double, Unknowns, Unknowns>& normal,
                                const Eigen::Matrix<double, Unknowns, 1>& right,
                                const std::array<Bounds, Unknowns>& bounds) {
  using Matrix = Eigen::Matrix<double, Unknowns, Unknowns>;
  using Vector = Eigen::Matrix<double, Unknowns, 1>;
  std::size_t combinations = 1;
  for (std::size_t k = 0; k < Unknowns; ++k) combinations *= 3;
  BoxSolution<Unknowns> best;
  for (std::size_t combination = 0; combination < combinations; ++combination) {
    BoxSolution<Unknowns> one;
    Vector fixed = Vector::Zero(), scale = Vector::Zero();
    bool possible = true;
    for (std::size_t k = 0, code = combination; k < Unknowns; ++k, code /= 3) {
      const auto i = static_cast<Eigen::Index>(k);
      one.holds[k] = static_cast<Hold>(code % 3);
      if (one.holds[k] == Hold::free && normal(i, i) > 0.0)
        scale(i) = 1.0 / std::sqrt(normal(i, i));
      else if (one.holds[k] == Hold::free)
        possible = false;
      else
        fixed(i) = one.holds[k] == Hold::lower ? bounds[k].lower : bounds[k].upper;
    }
    if (!possible) continue;
    Matrix scaled = scale.asDiagonal() * normal * scale.asDiagonal();
    for (Eigen::Index k = 0; k < scaled.rows(); ++k) scaled(k, k) = 1.0;
    const Vector rest = scale.asDiagonal() * (right - normal * fixed);
    one.x = fixed + scale.asDiagonal() * Eigen::LLT<Matrix>(scaled).solve(rest);
    for (std::size_t k = 0; k < Unknowns; ++k) {
      const double x = one.x(static_cast<Eigen::Index>(k));
      if (!(x >= bounds[k].lower && x <= bounds[k].upper)) possible = false;
    }
    one.value = one.x.dot(normal * one.x) - 2.0 * right.dot(one.x);
    if (possible && one.value < best.value) best = one;
    if (combination == 0 && possible) break;
  }
  return best;
}

}  // namespace combforce

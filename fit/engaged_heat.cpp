#include "fit/engaged_heat.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "fit/noise.hpp"

namespace combforce {
namespace {

// Beyond so many lobes of the window little of a tone's thermal motion comes from.
constexpr double far_lobes = 8.0;
constexpr std::size_t few_far = 4;

struct Node {
  double at, weight;
};

// sinc^2 in lobes of the window, and its mean beyond so many that a grid need not tell one from the next.
double weight_at(double lobes) {
  constexpr double told_apart = 64.0;
  const double argument = std::numbers::pi * lobes;
  const double sine = lobes < told_apart ? std::sin(argument) : std::numbers::sqrt2 / 2.0;
  return sine * sine / (argument * argument);
}

// Gauss's points on (from, to) for that weight (Golub, Welsch 1969, Math. Comp. 23, 221; the recurrence by
// Stieltjes' procedure on a fine grid).
void add_gauss_points(double from, double to, std::size_t count, std::vector<Node>& nodes) {
  constexpr Eigen::Index size = 4096;
  const double step = (to - from) / static_cast<double>(size);
  const Eigen::ArrayXd x =
      from + step * (Eigen::ArrayXd::LinSpaced(size, 0.0, static_cast<double>(size - 1)) + 0.5);
  const Eigen::ArrayXd weight = step * x.unaryExpr(&weight_at);
  const auto order = static_cast<Eigen::Index>(count);
  Eigen::MatrixXd jacobi = Eigen::MatrixXd::Zero(order, order);
  Eigen::ArrayXd before = Eigen::ArrayXd::Zero(size), polynomial = Eigen::ArrayXd::Ones(size);
  double norm_before = 1.0;
  for (Eigen::Index k = 0; k < order; ++k) {
    const double norm = (weight * polynomial.square()).sum();
    const double ratio = k > 0 ? norm / norm_before : 0.0;
    jacobi(k, k) = (weight * x * polynomial.square()).sum() / norm;
    if (k > 0) jacobi(k, k - 1) = jacobi(k - 1, k) = std::sqrt(ratio);
    const Eigen::ArrayXd next = (x - jacobi(k, k)) * polynomial - ratio * before;
    before = polynomial;
    polynomial = next;
    norm_before = norm;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(jacobi);
  for (Eigen::Index k = 0; k < order; ++k)
    nodes.push_back({solver.eigenvalues()(k), weight.sum() * std::pow(solver.eigenvectors()(0, k), 2)});
}

// n points miss rho^-2n of a function with poles so far from the middle of their interval, rho being the sum
// of the half axes of the ellipse through these with foci at the interval's ends.
double points_needed(double half_length, double distance) {
  constexpr double missed = 0.01;
  return std::ceil(0.5 * std::log(1.0 / missed) / std::asinh(distance / half_length));
}

// On (0, end), in lobes, for functions with poles half a `width` from there. One interval where few points
// do, otherwise one a lobe, a pair of lobes and so on.
std::vector<Node> points_for(double end, double width) {
  constexpr double fewest = 3.0, most_of_one = 8.0, most = 32.0;
  const auto count = [&](double length) {
    return static_cast<std::size_t>(std::clamp(points_needed(0.5 * length, 0.5 * width), fewest, most));
  };
  std::vector<Node> nodes;
  if (end <= 1.0 || points_needed(0.5 * end, 0.5 * width) <= most_of_one) {
    add_gauss_points(0.0, end, count(end), nodes);
    return nodes;
  }
  for (double from = 0.0, to = 1.0; from < end; from = to, to = std::min(2.0 * to, end))
    add_gauss_points(from, to, to > far_lobes ? std::min(count(to - from), few_far) : count(to - from),
                     nodes);
  return nodes;
}

}  // namespace

EngagedHeat::EngagedHeat(const Harmonics& harmonics, const Cantilever& cantilever, double temperature_k,
                         unsigned windows) {
  for (const auto& list : {harmonics.tones(), harmonics.warm()})
    for (const std::size_t n : list) {
      harmonics_.push_back(static_cast<std::ptrdiff_t>(n));
      if (n > 0) harmonics_.push_back(-static_cast<std::ptrdiff_t>(n));
    }
  const auto size = static_cast<Eigen::Index>(harmonics_.size());
  const auto tones = static_cast<Eigen::Index>(harmonics.tones().size());
  // Lobes of the window in a spacing of the harmonics, and in a mode's width.
  const double lobes = static_cast<double>(harmonics.periods()) * windows;
  double width = lobes;
  for (const Mode& mode : cantilever.modes)
    width = std::min(width, lobes * mode.frequency_hz / (mode.quality_factor * harmonics.spacing_hz()));
  for (const auto& [at, weight] : points_for(0.5 * lobes, width)) {
    const double offset = at / lobes;
    Point point{offset, Eigen::VectorXcd(size), Eigen::VectorXd(size), Eigen::MatrixXd(size, tones),
                Eigen::MatrixXd(size, tones)};
    for (Eigen::Index i = 0; i < size; ++i) {
      const double n = static_cast<double>(harmonics_[static_cast<std::size_t>(i)]) + offset;
      const double frequency_hz = std::abs(n) * harmonics.spacing_hz();
      const std::complex<double> stiffness = 1.0 / tip_response(cantilever, frequency_hz);
      point.stiffness(i) = n < 0.0 ? std::conj(stiffness) : stiffness;
      point.heat(i) = 2.0 * weight / lobes * harmonics.spacing_hz() *
                      tip_force_density(cantilever, frequency_hz, temperature_k);
      for (Eigen::Index tone = 0; tone < tones; ++tone) {
        const auto c = static_cast<double>(harmonics.tones()[static_cast<std::size_t>(tone)]);
        point.at_tones(i, tone) = offset / (n - c);
        point.at_mirrored_tones(i, tone) = offset / (n + c);
      }
    }
    points_.push_back(std::move(point));
  }
  matrix_.resize(size, size);
  factor_ = Eigen::PartialPivLU<Eigen::MatrixXcd>(size);
  right_.resize(size);
  solved_.resize(size);
  at_tones_.resize(size, tones);
  at_mirrored_tones_.resize(size, tones);
  warm_.resize(size, tones);
  hermitian_.resize(tones, tones);
  plain_.resize(tones, tones);
}

// Every tone's row of the weights times the inverse of the system's matrix, by its transpose.
void EngagedHeat::respond(const Point& point, const ForceGradient& gradient) {
  for (Eigen::Index column = 0; column < matrix_.cols(); ++column)
    for (Eigen::Index row = 0; row < matrix_.rows(); ++row) {
      const std::ptrdiff_t to = harmonics_[static_cast<std::size_t>(column)],
                           from = harmonics_[static_cast<std::size_t>(row)];
      const std::complex<double> turn(0.0, gradient.spacing * (static_cast<double>(from) + point.offset));
      matrix_(row, column) =
          (row == column ? point.stiffness(row) : 0.0) - gradient.coefficient(to - from, turn);
    }
  factor_.compute(matrix_);
  for (Eigen::Index tone = 0; tone < at_tones_.cols(); ++tone) {
    right_ = point.at_tones.col(tone);
    solved_ = factor_.solve(right_);
    at_tones_.col(tone) = solved_;
    right_ = point.at_mirrored_tones.col(tone);
    solved_ = factor_.solve(right_);
    at_mirrored_tones_.col(tone) = solved_;
  }
}

void EngagedHeat::covariance(const ForceGradient& gradient, Eigen::MatrixXd& covariance) {
  covariance.setZero();
  for (const Point& point : points_) {
    respond(point, gradient);
    // E[D conj(D)'] and E[D D'] of the tones D; offsets below 0 are those above, mirrored.
    warm_ = point.heat.asDiagonal() * at_tones_;
    hermitian_.noalias() = at_tones_.transpose().lazyProduct(warm_.conjugate());
    plain_.noalias() = warm_.transpose().lazyProduct(at_mirrored_tones_.conjugate());
    plain_.noalias() += at_mirrored_tones_.adjoint().lazyProduct(warm_);
    warm_ = point.heat.asDiagonal() * at_mirrored_tones_;
    hermitian_.noalias() += at_mirrored_tones_.adjoint().lazyProduct(warm_);
    for (Eigen::Index k = 0; k < plain_.rows(); ++k)
      for (Eigen::Index l = 0; l < plain_.cols(); ++l) {
        const std::complex<double> hermitian = hermitian_(k, l), plain = plain_(k, l);
        covariance(2 * k, 2 * l) += 0.5 * (hermitian + plain).real();
        covariance(2 * k + 1, 2 * l + 1) += 0.5 * (hermitian - plain).real();
        covariance(2 * k, 2 * l + 1) += 0.5 * (plain - hermitian).imag();
        covariance(2 * k + 1, 2 * l) += 0.5 * (plain + hermitian).imag();
      }
  }
}

}  // namespace combforce

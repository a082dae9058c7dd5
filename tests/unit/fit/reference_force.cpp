#include "tests/unit/fit/reference_force.hpp"

#include <boost/math/quadrature/gauss_kronrod.hpp>
#include <boost/math/tools/roots.hpp>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <numeric>

namespace combforce::test {
namespace {

using Kronrod = boost::math::quadrature::gauss_kronrod<double, 15>;
using Gauss = boost::math::quadrature::gauss<double, 7>;

template <typename Function>
double root(const Function& function, double a, double b) {
  const auto bracket =
      boost::math::tools::bisect(function, a, b, boost::math::tools::eps_tolerance<double>(50));
  return 0.5 * (bracket.first + bracket.second);
}

}  // namespace

ReferenceMotion::ReferenceMotion(std::span<const std::uint64_t> bins,
                                 std::span<const std::complex<double>> tones_nm, double spacing_hz)
    : tones_(tones_nm.begin(), tones_nm.end()) {
  std::uint64_t divisor = 0, highest = 0;
  for (const std::uint64_t bin : bins) divisor = std::gcd(divisor, bin);
  for (const std::uint64_t bin : bins) {
    const std::uint64_t harmonic = bin / divisor;
    highest = std::max(highest, harmonic);
    frequencies_.push_back(2.0 * std::numbers::pi * static_cast<double>(harmonic));
  }
  periods_per_s_ = static_cast<double>(divisor) * spacing_hz;
  const std::uint64_t steps = 16 * highest;
  const auto d_slope = [this](double t) { return slope(t); };
  double before = 0.0, slope_before = slope(before);
  cuts_.push_back(0.0);
  for (std::uint64_t i = 1; i <= steps; ++i) {
    const double t = static_cast<double>(i) / static_cast<double>(steps), slope_here = slope(t);
    if (slope_before * slope_here < 0.0) cuts_.push_back(root(d_slope, before, t));
    before = t;
    slope_before = slope_here;
  }
  cuts_.push_back(1.0);
}

double ReferenceMotion::at(double period) const {
  double d = 0.0;
  for (std::size_t i = 0; i < tones_.size(); ++i) {
    const double phase = frequencies_[i] * period;
    d += tones_[i].real() * std::cos(phase) - tones_[i].imag() * std::sin(phase);
  }
  return d;
}

double ReferenceMotion::slope(double period) const {
  double sum = 0.0;
  for (std::size_t i = 0; i < tones_.size(); ++i) {
    const double phase = frequencies_[i] * period;
    sum -= frequencies_[i] * (tones_[i].real() * std::sin(phase) + tones_[i].imag() * std::cos(phase));
  }
  return sum;
}

double ReferenceMotion::lowest_nm() const {
  double lowest = std::numeric_limits<double>::infinity();
  for (const double cut : cuts_) lowest = std::min(lowest, at(cut));
  return lowest;
}

std::vector<double> ReferenceMotion::crossings(double d_nm) const {
  std::vector<double> times;
  const auto side = [&](double t) { return at(t) - d_nm; };
  for (std::size_t i = 0; i + 1 < cuts_.size(); ++i)
    if (side(cuts_[i]) * side(cuts_[i + 1]) < 0.0) times.push_back(root(side, cuts_[i], cuts_[i + 1]));
  return times;
}

Eigen::MatrixXd ReferenceMotion::integrate(std::span<const Edge> edges, std::size_t columns,
                                           const Integrand& functions, double tolerance) const {
  return integrate_between(0.0, 1.0, edges, columns, functions, tolerance);
}

Eigen::MatrixXd ReferenceMotion::integrate_between(double from, double to, std::span<const Edge> edges,
                                                   std::size_t columns, const Integrand& functions,
                                                   double tolerance) const {
  std::vector<double> cuts{from, to};
  std::ranges::copy_if(cuts_, std::back_inserter(cuts), [&](double t) { return t > from && t < to; });
  std::ranges::sort(cuts);
  const std::vector<double> monotone = cuts;
  constexpr int steps = 32;  // a stretch between turning points; two roots within one step are not seen
  for (const Edge& edge : edges) {
    const auto side = [&](double t) { return edge(at(t), slope(t) * periods_per_s_); };
    for (std::size_t i = 0; i + 1 < monotone.size(); ++i) {
      double before = monotone[i], side_before = side(before);
      for (int step = 1; step <= steps; ++step) {
        const double t = std::lerp(monotone[i], monotone[i + 1], static_cast<double>(step) / steps);
        const double side_here = side(t);
        if (side_before * side_here < 0.0) cuts.push_back(root(side, before, t));
        before = t;
        side_before = side_here;
      }
    }
  }
  std::ranges::sort(cuts);
  Eigen::MatrixXd sum =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(2 * tones_.size()), static_cast<Eigen::Index>(columns));
  for (std::size_t i = 0; i + 1 < cuts.size(); ++i)
    add({cuts[i], cuts[i + 1]}, 0.0, 1.0, tolerance, 0, functions, sum);
  return sum;
}

// Over u from `begin` to `end` of t = stretch.begin + length (3 u^2 - 2 u^3).
void ReferenceMotion::add(const Stretch& stretch, double begin, double end, double tolerance, int depth,
                          const Integrand& functions, Eigen::MatrixXd& sum) const {
  const double middle = 0.5 * (begin + end), half = 0.5 * (end - begin);
  const double length = stretch.end - stretch.begin;
  Eigen::MatrixXd kronrod = Eigen::MatrixXd::Zero(sum.rows(), sum.cols()), gauss = kronrod;
  Eigen::VectorXd basis(sum.rows());
  Eigen::RowVectorXd values(sum.cols()), greatest = Eigen::RowVectorXd::Ones(sum.cols());
  const auto node = [&](double u, double kronrod_weight, double gauss_weight) {
    const double t = stretch.begin + length * u * u * (3.0 - 2.0 * u), dt = 6.0 * length * u * (1.0 - u);
    double d = 0.0, rate = 0.0;
    for (std::size_t i = 0; i < tones_.size(); ++i) {
      const double phase = frequencies_[i] * t, cosine = std::cos(phase), sine = std::sin(phase);
      d += tones_[i].real() * cosine - tones_[i].imag() * sine;
      rate -= frequencies_[i] * (tones_[i].real() * sine + tones_[i].imag() * cosine);
      basis(static_cast<Eigen::Index>(2 * i)) = cosine;
      basis(static_cast<Eigen::Index>(2 * i + 1)) = -sine;
    }
    functions(d, rate * periods_per_s_, {values.data(), static_cast<std::size_t>(values.size())});
    greatest = greatest.cwiseMax(values.cwiseAbs());
    kronrod.noalias() += (2.0 * half * dt * kronrod_weight) * basis * values;
    gauss.noalias() += (2.0 * half * dt * gauss_weight) * basis * values;
  };
  for (std::size_t i = 0; i < Kronrod::abscissa().size(); ++i) {
    const double x = half * Kronrod::abscissa()[i], weight = Kronrod::weights()[i];
    const double gauss_weight = i % 2 == 0 ? Gauss::weights()[i / 2] : 0.0;
    node(middle + x, weight, gauss_weight);
    if (i > 0) node(middle - x, weight, gauss_weight);
  }
  const Eigen::RowVectorXd error = (kronrod - gauss).cwiseAbs().colwise().maxCoeff();
  if (((error.array() > tolerance * length * (end - begin) * greatest.array()).any()) && depth < 40) {
    add(stretch, begin, middle, tolerance, depth + 1, functions, sum);
    add(stretch, middle, end, tolerance, depth + 1, functions, sum);
  } else {
    sum += kronrod;
  }
}

}  // namespace combforce::test

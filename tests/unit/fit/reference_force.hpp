// Phasors of a model force along a motion, another way than fit/ goes: the motion is its tones' cosines and
// sines; it is cut where bisection finds turning points (sign changes of d' on a grid of time) and crossings
// of the surface; each stretch is integrated by adaptive Gauss-Kronrod (nodes of Boost.Math), after one
// substitution that slows down at both its ends, where forces start as a root of the depth; derivatives are
// those of ceres::Jet through the model's force(), not its terms.
#pragma once

#include <ceres/jet.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <complex>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "fit/force_model.hpp"

namespace combforce::test {

class ReferenceMotion {
 public:
  // Functions of d and its velocity to integrate: writes one value a column.
  using Integrand = std::function<void(double d_nm, double velocity_nm_per_s, std::span<double> values)>;

  // `spacing_hz`: of the bins; 0: all velocities are 0.
  ReferenceMotion(std::span<const std::uint64_t> bins, std::span<const std::complex<double>> tones_nm,
                  double spacing_hz = 0.0);

  double at(double period) const;     // d, nm; time in periods of the motion
  double slope(double period) const;  // nm a period
  double lowest_nm() const;

  // Changes its sign where functions are not smooth.
  using Edge = std::function<double(double d_nm, double velocity_nm_per_s)>;

  // (2/T) integral f_j(d(t)) exp(-i w_i t) dt: a column a function, rows (re, im) of tone 0, 1, …. The
  // functions are smooth but at the edges, where they may jump, or grow as the distance to the power -1/2.
  // Gauss and Kronrod sums differ by less than `tolerance`, of functions beyond 1 of their greatest value.
  Eigen::MatrixXd integrate(std::span<const Edge> edges, std::size_t columns, const Integrand& functions,
                            double tolerance = 1e-8) const;

  // The same over [from, to], periods, alone: the functions are smooth there but at the turning points and
  // edges.
  Eigen::MatrixXd integrate_between(double from, double to, std::span<const Edge> edges, std::size_t columns,
                                    const Integrand& functions, double tolerance = 1e-8) const;

  // Times of turning points, ascending, between 0 and 1, which are in it too.
  std::span<const double> turning_points() const { return cuts_; }

  // When d crosses a value: ascending, within a period.
  std::vector<double> crossings(double d_nm) const;

 private:
  struct Stretch {
    double begin, end;  // periods
  };
  void add(const Stretch& stretch, double begin, double end, double tolerance, int depth,
           const Integrand& functions, Eigen::MatrixXd& sum) const;

  double periods_per_s_ = 0.0;
  std::vector<double> frequencies_;  // rad a period
  std::vector<std::complex<double>> tones_;
  std::vector<double> cuts_;  // 0, turning points, 1
};

// The surface, and where the force of a solid that lags behind the tip is clamped at 0.
template <typename Model>
std::vector<ReferenceMotion::Edge> edges_of(std::span<const double> p) {
  std::vector<ReferenceMotion::Edge> edges{[p](double d, double /*velocity*/) { return p[0] - d; }};
  if constexpr (DependsOnVelocity<Model>)
    edges.push_back([p](double d, double velocity) { return p[0] - d - Model::lag_s(p.data()) * velocity; });
  return edges;
}

// Columns: F, then dF/dp of each parameter; nN.
template <typename Model>
Eigen::MatrixXd reference_force(const ReferenceMotion& motion, std::span<const double> p,
                                double tolerance = 1e-8) {
  using Jet = ceres::Jet<double, static_cast<int>(Model::parameters)>;
  std::array<Jet, Model::parameters> jets;
  for (std::size_t k = 0; k < jets.size(); ++k) jets[k] = Jet(p[k], static_cast<int>(k));
  const auto force_and_derivatives = [&](double d, double velocity, std::span<double> values) {
    const Jet force = force_of<Model>(jets.data(), Jet(d), velocity);
    values[0] = force.a;
    std::copy_n(force.v.data(), Model::parameters, values.begin() + 1);
  };
  return motion.integrate(edges_of<Model>(p), 1 + Model::parameters, force_and_derivatives, tolerance);
}

// Column 0 alone.
template <typename Model>
std::vector<std::complex<double>> reference_phasors(const ReferenceMotion& motion,
                                                    std::span<const double> p) {
  const Eigen::MatrixXd sum =
      motion.integrate(edges_of<Model>(p), 1, [&](double d, double velocity, std::span<double> values) {
        values[0] = force_of<Model>(p.data(), d, velocity);
      });
  std::vector<std::complex<double>> phasors;
  for (Eigen::Index row = 0; row < sum.rows(); row += 2) phasors.emplace_back(sum(row, 0), sum(row + 1, 0));
  return phasors;
}

}  // namespace combforce::test

// The residuals that the solver sees: the paper's force balance with the linear parameters eliminated.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <span>
#include <vector>

#include "fit/bounded.hpp"
#include "fit/box_least_squares.hpp"
#include "fit/force_balance.hpp"
#include "fit/force_model.hpp"
#include "fit/linear_parameters.hpp"

namespace combforce {

// The parameters of a model that are not linear, in order; the first is the surface position.
template <typename Model>
constexpr auto nonlinear_parameters() {
  std::array<std::size_t, Model::parameters - Model::linear.size()> result{};
  std::size_t count = 0;
  for (std::size_t k = 0; k < Model::parameters; ++k)
    if (std::ranges::find(Model::linear, k) == Model::linear.end()) result[count++] = k;
  return result;
}

// sqrt(weight) (F_model - F_measured), scaled so that the measured forces have the norm 1, as a function of
// x: one unbounded coordinate a nonlinear parameter. The linear parameters are, at each x, those that make
// the residuals least within their bounds (variable projection, Golub and Pereyra 1973; the Jacobian is the
// exact one). The coordinate of a parameter that a HasRatio model scales is its ratio to the linear one. A
// cost functor for ceres::TinySolver. Thread-bound; only the constructor allocates.
template <typename Model>
class Residuals {
 public:
  static constexpr auto nonlinear = nonlinear_parameters<Model>();
  using Scalar = double;
  enum { NUM_RESIDUALS = Eigen::Dynamic, NUM_PARAMETERS = nonlinear.size() };
  using Parameters = std::array<double, Model::parameters>;
  using Coordinates = Eigen::Matrix<double, nonlinear.size(), 1>;

  Residuals(ForceBalance& balance, std::size_t tones)
      : balance_(&balance),
        forces_(tones),
        scales_(tones),
        terms_(index(tones), index(ForceBalance::columns<Model>)),
        residuals_(index(tones)),
        column_(index(tones)) {}

  void set_measured(std::span<const std::complex<double>> forces, std::span<const double> weights) {
    double square = 0.0;
    for (std::size_t i = 0; i < forces_.size(); ++i) square += weights[i] * std::norm(forces[i]);
    for (std::size_t i = 0; i < forces_.size(); ++i) {
      forces_[i] = forces[i];
      scales_[i] = std::sqrt(weights[i] / square);
    }
  }
  void set_bounds(std::span<const Bounds> bounds) {
    std::ranges::copy(bounds, bounds_.begin());
    for (std::size_t k = 0; k < nonlinear.size(); ++k) {
      const Bounds own = coordinate_bounds<Model>(nonlinear[k], bounds);
      bounded_[k] = Bounded(own.lower, own.upper);
    }
    release();
  }
  // Holds at its bound every nonlinear parameter that x has brought to its edge, until release(): there the
  // transformation is flat, and a solver creeps. True when one joins those held before.
  bool hold_at_edges(const Coordinates& x) {
    bool joined = false;
    for (std::size_t k = 0; k < nonlinear.size(); ++k) {
      if (held_[k] || !bounded_[k].at_edge(x(index(k)))) continue;
      held_[k] = joined = true;
      edges_(index(k)) = bounded_[k].bound(x(index(k)));
    }
    if (joined) valid_ = false;
    return joined;
  }
  // Holds the surface there, until release().
  void hold_surface(double p0) {
    held_[0] = true;
    edges_(0) = bounded_[0].inverse(p0);
  }
  void release() {
    held_.fill(false);
    valid_ = false;
  }
  // The balance has been prepared anew.
  void invalidate() { valid_ = false; }

  int NumResiduals() const { return static_cast<int>(2 * forces_.size()); }

  bool operator()(const double* x, double* residuals, double* jacobian) const {
    const Parameters p = solve_linear(x);
    if (!valid_) {  // beyond what is prepared: never a step to accept
      std::fill_n(residuals, NumResiduals(), 1e3);
      if (jacobian != nullptr)
        std::fill_n(jacobian, static_cast<std::size_t>(NumResiduals()) * nonlinear.size(), 0.0);
      return true;
    }
    for (std::size_t i = 0; i < forces_.size(); ++i) {
      residuals[2 * i] = scales_[i] * residuals_(index(i)).real();
      residuals[2 * i + 1] = scales_[i] * residuals_(index(i)).imag();
    }
    if (jacobian != nullptr)
      for (std::size_t k = 0; k < nonlinear.size(); ++k)
        project(p, nonlinear[k], held_[k] ? 0.0 : bounded_[k].slope(x[k], bounded_[k].value(x[k])),
                jacobian + k * static_cast<std::size_t>(NumResiduals()));
    return true;
  }

  Coordinates coordinates(const Parameters& p) const {
    Coordinates x;
    for (std::size_t k = 0; k < nonlinear.size(); ++k)
      x(index(k)) = held_[k] ? edges_(index(k))
                             : bounded_[k].inverse(p[nonlinear[k]] / unit_of<Model>(nonlinear[k], p.data()));
    return x;
  }
  // Up to where the contact reaches at x (force_model.hpp), and all parameters.
  double contact_top(const Coordinates& x) const {
    const Parameters p = unit_parameters(x.data());
    return contact_top_nm<Model>(p.data());
  }
  Parameters parameters(const Coordinates& x) const { return solve_linear(x.data()); }
  double squared_norm(const Coordinates& x) const {
    solve_linear(x.data());
    double sum = 0.0;
    for (std::size_t i = 0; i < forces_.size(); ++i)
      sum += weighted(i, residuals_(index(i)), residuals_(index(i)));
    return sum;
  }
  // Which of them are at a bound.
  std::array<bool, Model::parameters> held(const Coordinates& x) const {
    std::array<bool, Model::parameters> result{};
    solve_linear(x.data());
    for (std::size_t k = 0; k < nonlinear.size(); ++k)
      result[nonlinear[k]] = bounded_[k].at_bound(x(index(k)));
    for (std::size_t k = 0; k < Model::linear.size(); ++k)
      result[Model::linear[k]] = box_.holds[k] != Hold::free;
    if constexpr (HasRatio<Model>)
      if (bound_by_ratio(solution_)) std::swap(result[Model::ratio], result[Model::linear[0]]);
    return result;
  }

  // At any p: dF/dp and F_model - F_measured in nN, rows (re, im) of each tone.
  void linearize(const Parameters& p, Eigen::MatrixXd& jacobian, Eigen::VectorXd& residuals) {
    valid_ = false;
    balance_->template evaluate<Model>(p.data(), terms_);
    set_residuals(p);
    for (std::size_t k = 0; k < Model::parameters; ++k) {
      derivative(p, k);
      for (std::size_t i = 0; i < forces_.size(); ++i) {
        jacobian(index(2 * i), index(k)) = column_(index(i)).real();
        jacobian(index(2 * i + 1), index(k)) = column_(index(i)).imag();
      }
    }
    for (std::size_t i = 0; i < forces_.size(); ++i) {
      residuals(index(2 * i)) = residuals_(index(i)).real();
      residuals(index(2 * i + 1)) = residuals_(index(i)).imag();
    }
  }

 private:
  static constexpr std::size_t unknowns = Model::linear.size();
  using Normal = Eigen::Matrix<double, unknowns, unknowns>;
  using Right = Eigen::Matrix<double, unknowns, 1>;

  static Eigen::Index index(std::size_t i) { return static_cast<Eigen::Index>(i); }

  // The term of column j of terms_.
  static constexpr ModelTerm term(std::size_t j) {
    constexpr std::size_t contacts = Model::contact_terms.size();
    if (j < contacts) return Model::contact_terms[j];
    if constexpr (Model::tail_terms.empty())
      return {};
    else
      return Model::tail_terms[j - contacts];
  }

  // Evaluates the balance at x and finds the linear parameters; valid_ says whether x can be evaluated at
  // all.
  Parameters solve_linear(const double* x) const {
    const Coordinates at = Eigen::Map<const Coordinates>(x);
    if (valid_ && at == last_) return solution_;
    Parameters p = unit_parameters(x);
    valid_ = contact_top_nm<Model>(p.data()) <= balance_->ceiling_nm();
    if (!valid_) return p;
    balance_->template evaluate<Model>(p.data(), terms_);
    if constexpr (unknowns > 0) fit_linear(p);
    set_residuals(p);
    last_ = at;
    solution_ = p;
    return p;
  }

  // Enters the linear parameters that fit best.
  void fit_linear(Parameters& p) const {
    Right right = Right::Zero();
    normal_.setZero();
    for (std::size_t j = 0; j < ForceBalance::columns<Model>; ++j) {
      if (term(j).derivative != value_of_term) continue;
      const Eigen::Index row = unknown(term(j).linear);
      for (std::size_t i = 0; i < forces_.size(); ++i)
        right(row) += weighted(i, terms_(index(i), index(j)), forces_[i]);
      for (std::size_t l = 0; l < ForceBalance::columns<Model>; ++l)
        if (term(l).derivative == value_of_term)
          for (std::size_t i = 0; i < forces_.size(); ++i)
            normal_(row, unknown(term(l).linear)) +=
                weighted(i, terms_(index(i), index(j)), terms_(index(i), index(l)));
    }
    box_ = solve_box<unknowns>(normal_, right, linear_bounds<Model>(p.data(), bounds_));
    set_linear<Model>(box_, p);
  }

  // Whether the linear parameter is held by the bound of the one that it scales.
  bool bound_by_ratio(const Parameters& p) const {
    const Bounds &own = bounds_[Model::linear[0]], &scaled = bounds_[Model::ratio];
    const double ratio = p[Model::ratio] / p[Model::linear[0]];
    return (box_.holds[0] == Hold::lower && scaled.lower / ratio > own.lower) ||
           (box_.holds[0] == Hold::upper && scaled.upper / ratio < own.upper);
  }

  // The nonlinear parameters at x, the linear ones 1.
  Parameters unit_parameters(const double* x) const {
    Parameters p;
    p.fill(1.0);
    for (std::size_t k = 0; k < nonlinear.size(); ++k) p[nonlinear[k]] = bounded_[k].value(x[k]);
    return p;
  }

  static Eigen::Index unknown(std::size_t parameter) {
    return std::ranges::find(Model::linear, parameter) - Model::linear.begin();
  }

  // Share of tone i in the scalar product that E is made of.
  double weighted(std::size_t i, std::complex<double> a, std::complex<double> b) const {
    return scales_[i] * scales_[i] * (a.real() * b.real() + a.imag() * b.imag());
  }

  void set_residuals(const Parameters& p) const {
    for (std::size_t i = 0; i < forces_.size(); ++i) residuals_(index(i)) = -forces_[i];
    for (std::size_t j = 0; j < ForceBalance::columns<Model>; ++j)
      if (term(j).derivative == value_of_term)
        residuals_ += coefficient(p.data(), term(j)) * terms_.col(index(j));
  }

  // column_ = dF/dp of one parameter.
  void derivative(const Parameters& p, std::size_t parameter) const {
    column_.setZero();
    for (std::size_t j = 0; j < ForceBalance::columns<Model>; ++j) {
      if (term(j).derivative == parameter) column_ += coefficient(p.data(), term(j)) * terms_.col(index(j));
      if (term(j).derivative == value_of_term && term(j).linear == parameter) column_ += terms_.col(index(j));
    }
  }

  // Total derivative of the residuals with respect to a nonlinear parameter, the free linear ones following.
  void project(const Parameters& p, std::size_t parameter, double slope, double* out) const {
    derivative(p, parameter);
    if constexpr (unknowns > 0) let_linear_follow(p, parameter);
    for (std::size_t i = 0; i < forces_.size(); ++i) {
      out[2 * i] = scales_[i] * slope * column_(index(i)).real();
      out[2 * i + 1] = scales_[i] * slope * column_(index(i)).imag();
    }
  }

  // Makes column_ = dF one of dr = dF + B da, where (B'B) da = -(B'dF + dB'r) from B'r = 0.
  void let_linear_follow(const Parameters& p, std::size_t parameter) const {
    Normal normal = Normal::Identity();
    Right right = Right::Zero();
    for (std::size_t j = 0; j < ForceBalance::columns<Model>; ++j) {
      const Eigen::Index row = unknown(term(j).linear);
      if (box_.holds[static_cast<std::size_t>(row)] != Hold::free) continue;
      for (std::size_t i = 0; i < forces_.size(); ++i) {
        if (term(j).derivative == value_of_term)
          right(row) -= weighted(i, terms_(index(i), index(j)), column_(index(i)));
        if (term(j).derivative == parameter)
          right(row) -= weighted(i, terms_(index(i), index(j)), residuals_(index(i)));
      }
      for (std::size_t l = 0; l < unknowns; ++l)
        if (box_.holds[l] == Hold::free) normal(row, index(l)) = normal_(row, index(l));
    }
    Right follow = Eigen::LLT<Normal>(normal).solve(right);
    if constexpr (HasRatio<Model>)
      if (parameter == Model::ratio && bound_by_ratio(p))
        follow(0) = -p[Model::linear[0]] * p[Model::linear[0]] / p[Model::ratio];
    for (std::size_t j = 0; j < ForceBalance::columns<Model>; ++j)
      if (term(j).derivative == value_of_term)
        column_ += follow(unknown(term(j).linear)) * terms_.col(index(j));
  }

  ForceBalance* balance_;
  std::vector<std::complex<double>> forces_;
  std::vector<double> scales_;
  std::array<Bounded, nonlinear.size()> bounded_;
  std::array<Bounds, Model::parameters> bounds_{};
  std::array<bool, nonlinear.size()> held_{};  // at edges_
  Coordinates edges_ = Coordinates::Zero();
  // At last_, when valid_:
  mutable Eigen::MatrixXcd terms_;
  mutable Eigen::VectorXcd residuals_;  // nN
  mutable Coordinates last_;
  mutable Parameters solution_{};
  mutable Normal normal_;
  mutable BoxSolution<unknowns> box_;
  mutable bool valid_ = false;
  mutable Eigen::VectorXcd column_;  // scratch
};

}  // namespace combforce

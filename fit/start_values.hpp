// Where a fit begins. The minimum of the paper's E lies in a curved trench, and a solver that starts at a
// guess finds another one in a case out of six. The motion itself says where to look: the surface is near its
// lower turning point.
//
// A histogram of d over the period, with the phases of the tones as weights, gives model phasors at the cost
// of its bins, to a percent or so; where the force depends on velocity, one coarser histogram for each of a
// few classes of velocity, with the mean velocity in each bin; where it depends on history, for each surface
// position one of the time in which the tip would be held if contact had no end. On it p0 is scanned over
// depths below … above the turning point and over the model's shapes; the linear parameters follow by least
// squares, held at 0 or above. The best few minima of the scan are the starts.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "fit/box_least_squares.hpp"
#include "fit/excursion.hpp"
#include "fit/fit_result.hpp"
#include "fit/force_model.hpp"
#include "fit/linear_parameters.hpp"
#include "fit/motion.hpp"

namespace combforce {

// Thread-bound. Only the constructor allocates.
class StartValues {
 public:
  static constexpr std::size_t depths = 97, stride = 4;
  // Starts: more where E is rough.
  template <typename Model>
  static constexpr std::size_t most = DependsOnHistory<Model> ? 16 : 6;

  // What the model's force depends on, besides d.
  enum class Kind : std::uint8_t { deflection, velocity, history };
  template <typename Model>
  static constexpr Kind kind_of = DependsOnVelocity<Model>  ? Kind::velocity
                                  : DependsOnHistory<Model> ? Kind::history
                                                            : Kind::deflection;

  // For motions with the bins of this one; `velocity_per_slope`: of it.
  StartValues(const Motion& motion, Kind kind, double velocity_per_slope);

  // Builds the histogram of a motion.
  void set_motion(const Motion& motion);

  // Writes up to `most` starts, best first, each with every parameter of the model; returns how many.
  // `forces`: measured phasors, one a tone; `weights`: of their squares in the error to be minimised.
  template <typename Model>
  std::size_t scan(std::span<const std::complex<double>> forces, std::span<const double> weights,
                   std::span<const Bounds> bounds,
                   std::span<std::array<double, Model::parameters>, most<Model>> starts);

  // Starts all over the plausible: `dispersed_depths` depths from 0.5 % to half of the motion's span with the
  // model's middle shape each, deepest last. For a fit that has gone astray from those of the scan.
  static constexpr std::size_t dispersed_depths = 10;
  template <typename Model>
  void dispersed(std::span<const std::complex<double>> forces, std::span<const double> weights,
                 std::span<const Bounds> bounds,
                 std::span<std::array<double, Model::parameters>, dispersed_depths> starts);

 private:
  static constexpr std::size_t speeds = 4;     // classes of velocity, each way
  static constexpr double least_depth = 1e-3;  // surface position of a scan, of the span
  static constexpr double least_force_nn = 1e-3, greatest_force_nn = 1e4;
  static constexpr double worth_a_look = 1e3;
  static constexpr double doubt = 1e-5;  // (3 %)^2: error of the histogram's phasors, squared, of the forces'

  template <typename Model>
  struct Candidate {
    std::array<double, Model::parameters> p;
    double error = std::numeric_limits<double>::infinity();
    std::size_t shape = 0;  // nearest of the model's
  };

  // Places in a cell, and exp(i theta s) of every tone there times the sample's share of the cell.
  struct Samples {
    std::vector<double> places;
    std::vector<std::complex<double>> phases;
  };
  std::size_t histograms() const;
  std::size_t histogram_of(double d, double slope);
  std::size_t first_surface_above(double d) const;
  static Samples equidistant(const Motion& motion, std::size_t count);
  void add_samples(const Motion::Polynomial& c, const Samples& samples);

  // Number `index` of `count` surface positions: depths from `shallowest` of the motion's span to half of it,
  // or heights where the tip stays above the surface; where the force decays from p0 the greatest force of
  // the motion, from `least_force_nn` to `greatest_force_nn`.
  struct Place {
    double shallowest;
    std::size_t index, count;
  };
  template <typename Model>
  double surface(const Place& place, const std::array<double, Model::parameters>& shape) const;
  template <typename Model>
  Candidate<Model> candidate(const std::array<double, Model::parameters>& shape, const Place& place,
                             std::span<const std::complex<double>> forces, std::span<const double> weights,
                             std::span<const Bounds> bounds);
  template <typename Model>
  Candidate<Model> least_squares(std::array<double, Model::parameters> p,
                                 std::span<const std::complex<double>> forces,
                                 std::span<const double> weights, std::span<const Bounds> bounds) const;
  // (re, im) of each force.
  static double part(std::span<const std::complex<double>> forces, std::size_t row) {
    return row % 2 == 0 ? forces[row / 2].real() : forces[row / 2].imag();
  }
  template <typename Model>
  Candidate<Model> best_shape(const Place& place, std::size_t first, std::size_t last,
                              std::span<const std::complex<double>> forces, std::span<const double> weights,
                              std::span<const Bounds> bounds);
  template <typename Model>
  void add_bin(const double* p, std::size_t bin);
  template <DependsOnHistory Model>
  void add_held_bin(const double* p, std::size_t histogram, std::size_t bin);
  template <typename Model, std::size_t Terms>
  void add_terms(const std::array<ModelTerm, Terms>& terms, const std::array<double, Terms>& values,
                 Eigen::Index column, double share);

  Kind kind_;
  double velocity_per_slope_;
  std::size_t bins_;  // of a histogram
  double lowest_ = 0.0, span_ = 0.0, steepest_ = 0.0;
  std::vector<double> d_;  // of the bins: spaced as their index squared, closest at the turning point
  // (re, im a tone) x bins, of the classes of velocity one after the other: falling, then rising; or of the
  // surface positions of a scan.
  Eigen::MatrixXd histogram_;
  Excursion excursion_;
  std::vector<double> velocity_, time_;  // of the bins: mean, nm/s, and what it is the mean of
  Eigen::MatrixXd basis_;                // (re, im a tone) x linear parameters, or 1 of a unit coefficient
  std::vector<std::complex<double>> centre_;
  Samples fine_, medium_, coarse_;
};

template <typename Model>
double StartValues::surface(const Place& place,
                            [[maybe_unused]] const std::array<double, Model::parameters>& shape) const {
  const double share = static_cast<double>(place.index) / static_cast<double>(place.count - 1);
  if constexpr (StaysAboveSurface<Model>)
    return lowest_ - 2.0 * Model::least_height_nm * std::pow(100.0, share);
  else if constexpr (Decays<Model>)
    return lowest_ +
           shape[Model::decay] * std::lerp(std::log(least_force_nn), std::log(greatest_force_nn), share);
  else
    return lowest_ + span_ * place.shallowest * std::pow(0.5 / place.shallowest, share);
}

template <typename Model>
StartValues::Candidate<Model> StartValues::candidate(const std::array<double, Model::parameters>& shape,
                                                     const Place& place,
                                                     std::span<const std::complex<double>> forces,
                                                     std::span<const double> weights,
                                                     std::span<const Bounds> bounds) {
  std::array<double, Model::parameters> p = shape;
  p[0] = surface<Model>(place, shape);
  basis_.setZero();
  if constexpr (DependsOnHistory<Model>) {
    const std::size_t histogram = first_surface_above(p[0] - 1e-6 * (p[0] - lowest_));
    for (std::size_t bin = 0; bin < bins_; ++bin) add_held_bin<Model>(p.data(), histogram, bin);
  } else {
    for (std::size_t bin = 0; bin < d_.size(); ++bin) add_bin<Model>(p.data(), bin);
  }
  if constexpr (Model::linear.empty()) {
    double error = 0.0;
    for (std::size_t i = 0; i < 2 * forces.size(); ++i)
      error += weights[i / 2] * std::pow(part(forces, i) - basis_(static_cast<Eigen::Index>(i), 0), 2);
    return {p, error};
  } else {
    return least_squares<Model>(p, forces, weights, bounds);
  }
}

// With f the measured forces and B the model's phasors a unit of each linear parameter, minimises |W(B a -
// f)|^2.
template <typename Model>
StartValues::Candidate<Model> StartValues::least_squares(std::array<double, Model::parameters> p,
                                                         std::span<const std::complex<double>> forces,
                                                         std::span<const double> weights,
                                                         std::span<const Bounds> bounds) const {
  constexpr std::size_t unknowns = Model::linear.size();
  Eigen::Matrix<double, unknowns, unknowns> normal;
  Eigen::Matrix<double, unknowns, 1> right;
  normal.setZero();
  right.setZero();
  double constant = 0.0;
  for (std::size_t i = 0; i < 2 * forces.size(); ++i) {
    const double weight = weights[i / 2], force = part(forces, i);
    const auto b = basis_.row(static_cast<Eigen::Index>(i)).template head<unknowns>();
    constant += weight * force * force;
    right += weight * force * b.transpose();
    normal += weight * b.transpose() * b;
  }
  const BoxSolution<unknowns> solution =
      solve_box<unknowns>(normal, right, linear_bounds<Model>(p.data(), bounds));
  set_linear<Model>(solution, p);
  return {p, constant + solution.value};
}

template <typename Model>
void StartValues::add_bin(const double* p, std::size_t bin) {
  const auto column = static_cast<Eigen::Index>(bin);
  if (d_[bin] <= p[0])
    add_terms<Model>(Model::contact_terms, contact_of<Model>(p, p[0] - d_[bin], velocity_[bin]), column, 1.0);
  else if constexpr (!Model::tail_terms.empty())
    add_terms<Model>(Model::tail_terms, Model::tail(p, d_[bin] - p[0]), column, 1.0);
}

// Of the bin where contact is lost a share.
template <DependsOnHistory Model>
void StartValues::add_held_bin(const double* p, std::size_t histogram, std::size_t bin) {
  const double d = d_[bin],
               width = 0.5 * (d_[std::min(bin + 1, bins_ - 1)] - d_[std::max<std::size_t>(bin, 1) - 1]);
  const double release = Model::release_height_nm(p);
  const double share = std::clamp(0.5 + (p[0] + release - d) / width, 0.0, 1.0);
  if (!(share > 0.0)) return;
  const auto column = static_cast<Eigen::Index>(histogram * bins_ + bin);
  if (d <= p[0])
    add_terms<Model>(Model::contact_terms, Model::contact(p, p[0] - d), column, 1.0);
  else
    add_terms<Model>(Model::tail_terms, Model::tail(p, std::min(d - p[0], release)), column, share);
}

template <typename Model, std::size_t Terms>
void StartValues::add_terms(const std::array<ModelTerm, Terms>& terms,
                            const std::array<double, Terms>& values, Eigen::Index column, double share) {
  for (std::size_t t = 0; t < Terms; ++t) {
    if (terms[t].derivative != value_of_term) continue;
    const auto k = std::ranges::find(Model::linear, terms[t].linear) - Model::linear.begin();
    basis_.col(k) += share * values[t] * histogram_.col(column);
  }
}

template <typename Model>
std::size_t StartValues::scan(std::span<const std::complex<double>> forces, std::span<const double> weights,
                              std::span<const Bounds> bounds,
                              std::span<std::array<double, Model::parameters>, most<Model>> starts) {
  constexpr std::size_t shapes = Model::shapes.size();
  std::array<Candidate<Model>, depths> profile;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < depths; i += stride) {
    profile[i] = best_shape<Model>({least_depth, i, depths}, 0, shapes, forces, weights, bounds);
    least = std::min(least, profile[i].error);
  }
  for (std::size_t i = 0; i + stride < depths; i += stride) {
    const Candidate<Model>&left = profile[i], &right = profile[i + stride];
    if (std::min(left.error, right.error) > worth_a_look * least) continue;
    // Where E is rough the neighbours' shapes say little of those between.
    const bool rough = DependsOnHistory<Model>;
    const std::size_t first = rough ? 0 : std::max<std::size_t>(std::min(left.shape, right.shape), 1) - 1;
    const std::size_t last = rough ? shapes : std::min(std::max(left.shape, right.shape) + 2, shapes);
    for (std::size_t j = i + 1; j < i + stride; ++j)
      profile[j] = best_shape<Model>({least_depth, j, depths}, first, last, forces, weights, bounds);
  }
  std::array<Candidate<Model>, most<Model>> best;
  for (std::size_t i = 0; i < depths; ++i) {
    if (i > 0 && profile[i - 1].error < profile[i].error) continue;
    if (i + 1 < depths && profile[i + 1].error <= profile[i].error) continue;
    auto place =
        std::ranges::find_if(best, [&](const auto& other) { return profile[i].error < other.error; });
    if (place == best.end()) continue;
    std::move_backward(place, best.end() - 1, best.end());
    *place = profile[i];
  }
  double nothing = 0.0;
  for (std::size_t i = 0; i < forces.size(); ++i) nothing += weights[i] * std::norm(forces[i]);
  std::size_t count = 0;
  for (const auto& one : best)
    if (one.error < 10.0 * best[0].error + doubt * nothing) starts[count++] = one.p;
  return count;
}

template <typename Model>
void StartValues::dispersed(std::span<const std::complex<double>> forces, std::span<const double> weights,
                            std::span<const Bounds> bounds,
                            std::span<std::array<double, Model::parameters>, dispersed_depths> starts) {
  const auto& middle = Model::shapes[Model::shapes.size() / 2];
  for (std::size_t i = 0; i < dispersed_depths; ++i) {
    starts[i] = candidate<Model>(middle, {5e-3, i, dispersed_depths}, forces, weights, bounds).p;
  }
}

// The best of the model's shapes first … last - 1, then of the parabola through it and its neighbours (in the
// logarithm of the shape).
template <typename Model>
StartValues::Candidate<Model> StartValues::best_shape(const Place& place, std::size_t first, std::size_t last,
                                                      std::span<const std::complex<double>> forces,
                                                      std::span<const double> weights,
                                                      std::span<const Bounds> bounds) {
  std::array<Candidate<Model>, Model::shapes.size()> row;
  for (std::size_t r = first; r < last; ++r) {
    row[r] = candidate<Model>(Model::shapes[r], place, forces, weights, bounds);
    row[r].shape = r;
  }
  const auto least = static_cast<std::size_t>(
      std::min_element(row.begin() + first, row.begin() + last,
                       [](const auto& a, const auto& b) { return a.error < b.error; }) -
      row.begin());
  if (least == first || least + 1 == last) return row[least];
  const double before = row[least - 1].error - row[least].error,
               after = row[least + 1].error - row[least].error;
  const double offset = 0.5 * (before - after) / (before + after);
  std::array<double, Model::parameters> shape = Model::shapes[least];
  const auto& towards = Model::shapes[offset > 0.0 ? least + 1 : least - 1];
  for (std::size_t k = 1; k < shape.size(); ++k)
    shape[k] *= std::pow(towards[k] / shape[k], std::abs(offset));
  Candidate<Model> between = candidate<Model>(shape, place, forces, weights, bounds);
  between.shape = least;
  return between.error < row[least].error ? between : row[least];
}

}  // namespace combforce

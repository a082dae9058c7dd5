// How the linear parameters of a model are taken apart from the others: a search moves coordinates, and least
// squares give the linear parameters at each. The coordinates are the nonlinear parameters themselves, but
// for one that a HasRatio model scales: that one's is its ratio to the linear parameter, and its bounds are
// kept by those of both.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>

#include "fit/box_least_squares.hpp"
#include "fit/force_model.hpp"

namespace combforce {

// What coordinate k is measured in, at these parameters.
template <typename Model>
double unit_of(std::size_t k, const double* p) {
  if constexpr (HasRatio<Model>)
    if (k == Model::ratio) return p[Model::linear[0]];
  return 1.0;
}

// Bounds of coordinate k, for bounds of all parameters.
template <typename Model>
Bounds coordinate_bounds(std::size_t k, std::span<const Bounds> bounds) {
  if constexpr (HasRatio<Model>) {
    const Bounds &own = bounds[k], &unit = bounds[Model::linear[0]];
    if (k == Model::ratio) return {own.lower / unit.upper, own.upper / unit.lower};
  }
  return bounds[k];
}

// Bounds of the linear parameters where `p` holds the coordinates.
template <typename Model>
std::array<Bounds, Model::linear.size()> linear_bounds([[maybe_unused]] const double* p,
                                                       std::span<const Bounds> bounds) {
  std::array<Bounds, Model::linear.size()> box;
  for (std::size_t k = 0; k < box.size(); ++k) box[k] = bounds[Model::linear[k]];
  if constexpr (HasRatio<Model>) {
    const Bounds& scaled = bounds[Model::ratio];
    box[0] = {std::max(box[0].lower, scaled.lower / p[Model::ratio]),
              std::min(box[0].upper, scaled.upper / p[Model::ratio])};
  }
  return box;
}

// Makes the parameters of coordinates: enters the linear ones.
template <typename Model>
void set_linear(const BoxSolution<Model::linear.size()>& solution, std::span<double, Model::parameters> p) {
  for (std::size_t k = 0; k < Model::linear.size(); ++k)
    p[Model::linear[k]] = solution.x(static_cast<Eigen::Index>(k));
  if constexpr (HasRatio<Model>) p[Model::ratio] *= p[Model::linear[0]];
}

}  // namespace combforce

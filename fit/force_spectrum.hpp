// The spectrum of a model's force along a whole motion: measured tones and all other bins up to a band limit.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <span>
#include <vector>

#include "fit/cell_quadrature.hpp"
#include "fit/cell_transform.hpp"
#include "fit/fit_result.hpp"

namespace combforce {

// Thread-bound. Only the constructor allocates.
class ForceSpectrum {
 public:
  using Spectrum = std::vector<std::complex<double>>;  // harmonics 0 … band: the mean, then peak phasors

  // `spacing_hz`: of the harmonics.
  ForceSpectrum(std::size_t highest_tone, std::size_t band, double spacing_hz)
      : transform_(highest_tone, band),
        quadrature_(2.0 * static_cast<double>(transform_.cells()) * spacing_hz),
        polynomials_(transform_.cells()),
        moments_(transform_.cells() * CellTransform::order) {
    for (auto& moments : derivative_moments_) moments.resize(transform_.cells() * CellTransform::low_order);
    damping_moments_.resize(transform_.cells() * CellTransform::low_order);
  }

  std::size_t band() const { return transform_.band(); }

  void set_motion(std::span<const std::complex<double>> spectrum) {
    transform_.to_polynomials(spectrum, polynomials_);
  }

  // Phasors of the force, nN, at these parameters, on this level of the quadrature (cell_quadrature.hpp).
  template <typename Model>
  void force(const double* p, std::size_t level, Spectrum& force);

  // The same with the phasors of dF/dp_k, good to 2 % at the highest tone, far better below, and of
  // dF/d(velocity), nN s/nm, where the model has it.
  template <typename Model>
  void linearize(const double* p, std::size_t level, Spectrum& force,
                 std::span<Spectrum, Model::parameters> derivatives, Spectrum& damping);

 private:
  // Of the force in a cell; returns the moments of the model's terms there.
  template <typename Model>
  CellQuadrature::Sum<Model> set_force_moments(const double* p, std::size_t cell);
  // Coefficient of term j of a model in F, and in dF/dp_k.
  template <typename Model>
  static constexpr ModelTerm term(std::size_t j) {
    if constexpr (Model::tail_terms.empty())
      return Model::contact_terms[j];
    else
      return j < Model::contact_terms.size() ? Model::contact_terms[j]
                                             : Model::tail_terms[j - Model::contact_terms.size()];
  }
  template <typename Model>
  static double share(const double* p, std::size_t j) {
    return term<Model>(j).derivative == value_of_term ? coefficient(p, term<Model>(j)) : 0.0;
  }
  template <typename Model>
  static double share_in_derivative(const double* p, std::size_t j, std::size_t k) {
    if (term<Model>(j).derivative == k) return coefficient(p, term<Model>(j));
    return term<Model>(j).derivative == value_of_term && term<Model>(j).linear == k ? 1.0 : 0.0;
  }

  CellTransform transform_;
  CellQuadrature quadrature_;
  std::vector<Motion::Polynomial> polynomials_;
  std::vector<double> moments_;                                         // cells x order
  std::array<std::vector<double>, max_parameters> derivative_moments_;  // each cells x low_order
  std::vector<double> damping_moments_;                                 // cells x low_order
};

template <typename Model>
CellQuadrature::Sum<Model> ForceSpectrum::set_force_moments(const double* p, std::size_t cell) {
  constexpr std::size_t order = CellTransform::order;
  CellQuadrature::Sum<Model> sum{};
  quadrature_.add_cell<Model>(p, polynomials_[cell], sum);
  for (std::size_t k = 0; k < order; ++k) {
    double moment = 0.0;
    for (std::size_t j = 0; j < sum.moments.size(); ++j) moment += share<Model>(p, j) * sum.moments[j][k];
    moments_[cell * order + k] = moment;
  }
  return sum;
}

template <typename Model>
void ForceSpectrum::force(const double* p, std::size_t level, Spectrum& force) {
  quadrature_.set_level(level);
  for (std::size_t cell = 0; cell < transform_.cells(); ++cell) set_force_moments<Model>(p, cell);
  transform_.to_phasors(moments_, CellTransform::order, force);
}

template <typename Model>
void ForceSpectrum::linearize(const double* p, std::size_t level, Spectrum& force,
                              std::span<Spectrum, Model::parameters> derivatives, Spectrum& damping) {
  constexpr std::size_t low = CellTransform::low_order;
  quadrature_.set_level(level);
  for (std::size_t cell = 0; cell < transform_.cells(); ++cell) {
    const CellQuadrature::Sum<Model> sum = set_force_moments<Model>(p, cell);
    for (std::size_t q = 0; q < Model::parameters; ++q)
      for (std::size_t k = 0; k < low; ++k) {
        double moment = 0.0;
        for (std::size_t j = 0; j < sum.moments.size(); ++j)
          moment += share_in_derivative<Model>(p, j, q) * sum.moments[j][k];
        derivative_moments_[q][cell * low + k] = moment;
      }
    if constexpr (DependsOnVelocity<Model>)
      for (std::size_t k = 0; k < low; ++k) {
        double moment = 0.0;
        for (std::size_t j = 0; j < sum.moments.size(); ++j)
          if (term<Model>(j).derivative == velocity_of_term)
            moment += coefficient(p, term<Model>(j)) * sum.moments[j][k];
        damping_moments_[cell * low + k] = moment;
      }
  }
  transform_.to_phasors(moments_, CellTransform::order, force);
  for (std::size_t q = 0; q < Model::parameters; ++q)
    transform_.to_phasors(derivative_moments_[q], low, derivatives[q]);
  if constexpr (DependsOnVelocity<Model>) transform_.to_phasors(damping_moments_, low, damping);
}

}  // namespace combforce

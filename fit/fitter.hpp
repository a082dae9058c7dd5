// What a fit of one model does with one pixel. Its kinds are class templates, model_fitter.hpp and for
// polynomials linear_fitter.hpp; this interface keeps their instances in units of their own (fitters/).
#pragma once

#include <complex>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "fit/box_least_squares.hpp"
#include "fit/engaged_heat.hpp"
#include "fit/fit_result.hpp"
#include "fit/force_balance.hpp"
#include "fit/force_model.hpp"
#include "fit/harmonics.hpp"
#include "fit/measured_force.hpp"
#include "fit/whitening.hpp"

namespace combforce {

struct FitterSetup {
  ForceBalance& balance;  // outlives the fitter
  std::size_t tones;
  std::span<const Bounds> bounds;  // one a parameter
  const Harmonics* harmonics;      // outlives the fitter; null: the paper's fit
  EngagedHeat* heat;               // the same
  std::uint32_t refine;            // iterations beyond the paper's fit, from each start
  bool profile_intervals;          // of a refined fit
};

// Thread-bound. fit() and error() do not allocate.
class Fitter {
 public:
  Fitter() = default;
  Fitter(const Fitter&) = delete;
  Fitter& operator=(const Fitter&) = delete;
  virtual ~Fitter() = default;

  // The balance holds the motion of these tones, nm. Fills `result`.
  // `weights`: of squared residuals in the paper's fit and in all scans for starts, one a tone; `whitening`:
  // of the refined fit and of chi^2. `start`: empty to scan.
  virtual void fit(const MeasuredForce& measured, std::span<const std::complex<double>> tones,
                   std::span<const double> weights, const Whitening& whitening, std::span<const double> start,
                   FitResult& result) = 0;

  // E at `parameters` (paper, equation 9) with these weights; where there are several quadratures, on the
  // first that the next finer one confirms to 1e-6.
  virtual double error(const MeasuredForce& measured, std::span<const double> weights,
                       std::span<const double> parameters) = 0;
};

template <NeedsSearch Model>
std::unique_ptr<Fitter> make_fitter(const FitterSetup& setup);  // model_fitter.hpp
template <IsPolynomial Model>
std::unique_ptr<Fitter> make_fitter(const FitterSetup& setup);  // linear_fitter.hpp

}  // namespace combforce

// From residuals and Jacobian at the minimum to standard errors: the sandwich formula.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>

#include "fit/fit_result.hpp"

namespace combforce {

// Rows are (re, im) of tone 0, 1, …; all spans of tones have half as many entries as there are rows.
struct Linearization {
  Eigen::Ref<const Eigen::MatrixXd> jacobian;  // dF/dp, rows x parameters
  std::span<const double> weights;             // of squares in the error that was minimised, one a tone
  std::array<bool, max_parameters> fixed;      // parameters at a bound: held there
};

// How far the minimum moves when the model's phasors change by `shift` (rows): -(J'WJ)^-1 J'W shift. 0 for
// fixed parameters; NaN where J'WJ is singular. Does not allocate.
std::array<double, max_parameters> minimum_shift(const Linearization& at,
                                                 const Eigen::Ref<const Eigen::VectorXd>& shift);

// Fills std_errors, correlation and chi2_reduced of `result`:
//     cov = (J'WJ)^-1 J'W S WJ (J'WJ)^-1,   S = `covariance` of the residuals, rows x rows;
//     chi2_reduced = chi2 / (rows - free parameters), NaN when there are no degrees of freedom.
// NaN for fixed parameters, and where a parameter is not determined at all. Returns whether J'WJ, scaled to a
// unit diagonal, has eigenvalues within 1e-12 of each other: beyond, the parameters are not determined. Does
// not allocate.
bool estimate_uncertainty(const Linearization& at, const Eigen::Ref<const Eigen::MatrixXd>& covariance,
                          double chi2, bool noise_known, FitResult& result);

}  // namespace combforce

// What a fit says of a pixel. Fixed capacity: results travel through preallocated slots.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>

namespace combforce {

inline constexpr std::size_t max_parameters = 6;
inline constexpr std::size_t most_compared = 8;  // models beside the one of a fit

struct ModelInfo;

enum class FitStatus : std::uint8_t {
  converged,      // parameters valid
  not_converged,  // parameters: the last iterate, to be distrusted
  // A parameter stopped at its bound: parameters valid, errors of that one are not. Or, of a model whose
  // force depends on history, the search stopped where the error E jumps, more than a standard error from
  // where it was going.
  at_bound,
  // A relative standard error exceeds 30 %: parameters valid but weakly determined. Or, of a polynomial, the
  // tones do not tell all powers: those are NaN.
  ill_conditioned,
  no_contact,        // no force above noise: parameters NaN
  no_free_response,  // nothing to refer a force to: parameters NaN
  not_fitted,        // the pool was full: parameters NaN; refit from the recording
  flagged,           // the pixel carries a flag: parameters NaN
  // Parameters to be distrusted: chi^2 says that the model does not explain the pixel; or, with noise known
  // or not, the motion that a refined fit found would not last but, say, double its period
  // (engaged_heat.hpp). The tones of a window that holds both periods show nothing of it.
  misfit,
  ambiguous  // other parameters explain the pixel as well: see `alternative`
};

constexpr std::array<double, max_parameters> unknown_values() {
  std::array<double, max_parameters> values{};
  values.fill(std::numeric_limits<double>::quiet_NaN());
  return values;
}
constexpr std::array<std::array<double, 2>, max_parameters> unknown_intervals() {
  std::array<std::array<double, 2>, max_parameters> intervals{};
  for (auto& interval : intervals) interval.fill(std::numeric_limits<double>::quiet_NaN());
  return intervals;
}

// What another model makes of the pixel.
struct ComparedModel {
  const ModelInfo* model = nullptr;
  FitStatus status = FitStatus::not_fitted;
  double chi2_reduced = 0.0, aicc = 0.0;  // NaN: not known
};

// Arrays are in the model's order; only the first `parameters_count` are meaningful. NaN: not known. Default:
// as for `not_fitted`.
struct FitResult {
  FitStatus status = FitStatus::not_fitted;
  std::uint32_t refinements = 0;  // off-comb iterations done (0: the paper's partial motion)
  std::uint32_t iterations = 0;   // of the solver, all starts and grids together
  std::uint32_t parameters_count = 0;
  std::uint32_t free_parameters = 0;  // of them: not held at a bound, nor without effect
  double chi2_reduced = 0.0;          // NaN without a noise model or degrees of freedom
  std::array<double, max_parameters> parameters{};
  std::array<double, max_parameters> std_errors{};
  // Profile intervals, where they were asked for: [lower, upper] at which the least chi^2 over the other
  // parameters has risen by 1, or the parameter's bound before. 68 % also where the standard errors, their
  // linear approximation, do not hold. NaN: not known.
  std::array<std::array<double, 2>, max_parameters> intervals = unknown_intervals();
  // Standard errors by the cantilever's uncertainty alone, the same for all pixels alike and so not part of
  // std_errors. NaN: not asked for, or not found.
  std::array<double, max_parameters> calibration_errors = unknown_values();
  // corrected_akaike() of this fit and of others, where a comparison was asked for.
  double aicc = std::numeric_limits<double>::quiet_NaN();
  std::uint32_t compared_count = 0;
  std::array<ComparedModel, most_compared> compared{};
  // How far the parameters move if the quadrature of the force balance is refined: its own error estimate.
  std::array<double, max_parameters> quadrature_errors{};
  // Strict upper triangle, row by row: (0,1), (0,2), …, (1,2), …
  std::array<double, max_parameters*(max_parameters - 1) / 2> correlation{};
  // A second minimum whose chi^2 is above that of the first by less than 4; delta NaN: none was found, or not
  // sought.
  double alternative_delta_chi2 = std::numeric_limits<double>::quiet_NaN();
  std::array<double, max_parameters> alternative{};
  // Of the measured tones, and where a refined fit has converged of the motion off the comb too: then the
  // dissipated power is that of the whole motion, 0 for a conservative force. A conservative force moves
  // power from tone to tone, so without refinement the sum over the measured ones alone means little.
  double virial_nn_nm = 0.0;   // F_0 d_0 + 1/2 sum Re(F_i conj d_i)
  double dissipated_fw = 0.0;  // -1/2 sum w_i Im(F_i conj d_i), 1e-15 W
};

// Reports a second minimum when its chi^2 is above the first one's by less than this: two standard
// deviations. A status `converged` becomes `ambiguous`; others say already that the parameters are not to be
// relied on.
inline constexpr double indistinguishable_delta_chi2 = 4.0;
void report_alternative(std::span<const double> parameters, double delta_chi2, FitResult& result);

// Akaike's information criterion corrected for few data, chi^2 + 2k + 2k(k + 1)/(n - k - 1), of n data and k
// fitted parameters (Hurvich, Tsai 1989, Biometrika 76, 297): of two models the one with the lesser value is
// expected to predict better, clearly so when they differ by more than about 5. With the noise known chi^2 +
// 2k would do; the correction, made for noise that is estimated, errs on the side of fewer parameters, the
// more the fewer the data. The determinant of the noise's covariance, which depends a little on the model in
// refined fits, is left out. NaN: chi^2 is not known, or n <= k + 1.
double corrected_akaike(const FitResult& result, std::size_t data);

// Everything unknown, with the given status.
FitResult unfitted(FitStatus status, std::size_t parameters_count);

}  // namespace combforce

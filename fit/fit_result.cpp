#include "fit/fit_result.hpp"

#include <algorithm>
#include <limits>

namespace combforce {

void report_alternative(std::span<const double> parameters, double delta_chi2, FitResult& result) {
  if (!(delta_chi2 < indistinguishable_delta_chi2)) return;
  result.alternative_delta_chi2 = delta_chi2;
  std::ranges::copy(parameters, result.alternative.begin());
  if (result.status == FitStatus::converged) result.status = FitStatus::ambiguous;
}

double corrected_akaike(const FitResult& result, std::size_t data) {
  const auto n = static_cast<double>(data), k = static_cast<double>(result.parameters_count);
  if (!(n > k + 1.0)) return std::numeric_limits<double>::quiet_NaN();
  return result.chi2_reduced * (n - result.free_parameters) + 2.0 * k + 2.0 * k * (k + 1.0) / (n - k - 1.0);
}

FitResult unfitted(FitStatus status, std::size_t parameters_count) {
  constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
  FitResult result;
  result.status = status;
  result.parameters_count = static_cast<std::uint32_t>(parameters_count);
  result.chi2_reduced = unknown;
  result.parameters.fill(unknown);
  result.std_errors.fill(unknown);
  result.quadrature_errors.fill(unknown);
  result.intervals = unknown_intervals();
  result.correlation.fill(unknown);
  result.alternative_delta_chi2 = unknown;
  result.alternative.fill(unknown);
  result.virial_nn_nm = unknown;
  result.dissipated_fw = unknown;
  return result;
}

}  // namespace combforce

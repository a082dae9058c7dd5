// The paper's tables 2 and 3: parameters without noise, and their scatter over 100 draws of it.
#pragma once

#include <vector>

#include "daemon/cli/paper/cases.hpp"

namespace combforce::paper {

// Statistics of one parameter over draws of the noise.
struct Scatter {
  double mean = 0.0;
  double spread = 0.0;    // standard deviation, n - 1
  double kurtosis = 0.0;  // fourth moment over the square of the variance; 3 for a Gaussian
};

struct TableRow {
  const Case* of = nullptr;
  FitResult noise_free;
  std::vector<FitResult> noisy;  // one a draw
  std::vector<Scatter> scatter;  // one a parameter
  std::size_t valid = 0;         // draws whose parameters entered the scatter
};

Scatter scatter_of(std::span<const double> values);

bool has_parameters(const FitResult& fit);  // converged, at a bound, or weakly determined

TableRow fit_case(const CaseMotion& motion);

}  // namespace combforce::paper

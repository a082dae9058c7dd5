// The paper's tables 2 and 3: parameters without noise, and their scatter over draws of it.
#pragma once

#include <vector>

#include "daemon/cli/paper/cases.hpp"

namespace combforce::paper {

// Statistics of one parameter over draws of the noise.
struct Scatter {
  double mean = 0.0;
  double spread = 0.0;    // standard deviation, n - 1
  double kurtosis = 0.0;  // fourth moment over the square of the variance; 3 for a Gaussian
  double lower = 0.0, median = 0.0, upper = 0.0;  // quantiles 0.16, 0.5, 0.84
};

// One fit a draw of the noise.
struct Draws {
  std::vector<FitResult> fits;
  std::vector<Scatter> scatter;  // one a parameter
  std::size_t valid = 0;         // fits whose parameters entered the scatter
};

struct TableRow {
  const Case* of = nullptr;
  FitResult noise_free;
  Draws least;       // our fitter as it is: it scans for the least E
  Draws from_truth;  // the same draws, the search begun at the true parameters: it stays in the minimum near
                     // them
};

// NaN throughout for fewer than two values.
Scatter scatter_of(std::span<const double> values);

bool has_parameters(const FitResult& fit);  // converged, at a bound, weakly determined, ambiguous

// `draws`: at most all that cases.hpp has.
TableRow fit_case(const CaseMotion& motion, std::size_t draws);

}  // namespace combforce::paper

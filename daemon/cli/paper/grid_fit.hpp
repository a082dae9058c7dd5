// The paper's own quadrature: the model force sampled at 400,000 equal steps of the window and transformed.
// Our fitter does without its error; this one tells how much of a difference to the paper it explains.
#pragma once

#include <vector>

#include "daemon/cli/paper/cases.hpp"

namespace combforce::paper {

struct GridFit {
  bool converged = false;
  std::vector<double> parameters;
};

// Levenberg-Marquardt without bounds, as the paper's, on its E from `start`, for these tones of the motion's
// case. The sum over the window is taken over one period of the partial motion, of which the window holds a
// whole number.
GridFit fit_on_grid(const CaseMotion& motion, std::span<const std::complex<double>> tip_nm,
                    std::span<const double> start);

}  // namespace combforce::paper

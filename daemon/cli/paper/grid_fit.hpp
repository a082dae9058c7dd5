// The paper's own procedure: the model force sampled at 400,000 equal steps of the window and transformed,
// and its E minimised by MINPACK's lmdif as scipy's leastsq calls it (forward differences, ftol = xtol
// = 1.5e-8, no bounds; here Eigen's translation). Our fitter does without the errors of either; this one
// tells how much of a difference to the paper they explain.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "daemon/cli/paper/cases.hpp"

namespace combforce::paper {

struct GridFit {
  bool converged = false;  // leastsq's ier is 1 to 4
  std::vector<double> parameters;
};

// One pixel's problem on the grid. fit() is reentrant.
class GridProblem {
 public:
  // For these tones of the motion's case, sampled `displacement` sample intervals after the window's own
  // samples. The sum over the window is taken over one period of the partial motion, of which the window
  // holds a whole number.
  GridProblem(const CaseMotion& motion, std::span<const std::complex<double>> tip_nm,
              double displacement = 0.0);

  GridFit fit(std::span<const double> start) const;

 private:
  const Case* of_;
  Eigen::VectorXd d_nm_;  // one a sample of a period, in ascending order
  Eigen::MatrixXd
      turn_;  // [(re, im) of each tone][sample]: a column times a force is its part of the phasors
  Eigen::VectorXd measured_nn_;  // (re, im) of each tone
};

}  // namespace combforce::paper

// The paper's figure 3: force curves with the parameters of every noisy fit, beside the true one.
#pragma once

#include <vector>

#include "daemon/cli/paper/cases.hpp"
#include "daemon/cli/paper/tables.hpp"

namespace combforce::paper {

struct ForceCurves {
  const Case* of = nullptr;
  std::vector<double> d_nm;                    // from the deepest point of the motion up
  std::vector<double> true_nn;                 // one a d
  std::vector<std::vector<double>> fitted_nn;  // one curve a valid draw
  // Of the largest |fitted - true| of each curve over d_nm: median and maximum over the curves.
  double median_largest_nn = 0.0, largest_nn = 0.0;
  double rms_nn = 0.0;            // over all curves and d_nm
  double share_below_1_nn = 0.0;  // of all points of all curves
};

ForceCurves force_curves(const CaseMotion& motion, const TableRow& row);

}  // namespace combforce::paper

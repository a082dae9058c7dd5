// The paper's figure 2: E over (p0, p1) of the Hertz model, and from where solvers find its minimum.
#pragma once

#include <cstdint>
#include <vector>

#include "daemon/cli/paper/cases.hpp"
#include "daemon/cli/paper/tables.hpp"

namespace combforce::paper {

// Fits begun at points of a grid.
struct Starts {
  std::vector<double> p0_nm, p1;
  std::vector<std::uint8_t> found;             // [p0][p1]: it ends in the minimum
  double first_p0_nm = 0.0, last_p0_nm = 0.0;  // between these (on the grid) every one does
  double found_share = 0.0;
};

struct ErrorMap {
  const Case* of = nullptr;
  std::vector<double> p0_nm, p1;  // the grid
  std::vector<double> error_nn2;  // [p0][p1]
  Starts ours;                    // our fitter; it eliminates p1, so its starts differ in p0 alone
  Starts papers;                  // the paper's own fit (grid_fit.hpp), on a grid twice as wide
};

// `minimum`: parameters of the noise-free fit of this case, which has two parameters.
ErrorMap map_error(const CaseMotion& motion, const FitResult& minimum);

}  // namespace combforce::paper

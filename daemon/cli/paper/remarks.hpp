// Why our numbers differ from the printed ones: computed, and only where the last printed digit differs. What
// no computation here accounts for is called not explained.
#pragma once

#include <string>
#include <vector>

#include "daemon/cli/paper/tables.hpp"

namespace combforce::paper {

// Rounded to the paper's decimals, `ours` is not what is printed.
bool differs(double ours, double printed);

// Of the noise-free row: what the paper's quadrature gives on the same motion (grid_fit.hpp), and how large
// an error of the paper's tones would be needed for the rest.
std::vector<std::string> noise_free_remarks(const CaseMotion& motion, const TableRow& row);

// Of the row with noise: differences in units of the sampling error of two sets of 100 draws; where that is
// not enough, what the paper's procedure, a local search on its grid, gives for the same draws.
std::vector<std::string> scatter_remarks(const CaseMotion& motion, const TableRow& row);

}  // namespace combforce::paper

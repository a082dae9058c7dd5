// Why our numbers differ from the printed ones: computed, and only where the last printed digit differs. What
// no computation here accounts for is called not explained.
#pragma once

#include <string>
#include <vector>

#include "daemon/cli/paper/tables.hpp"

namespace combforce::paper {

// Rounded to the paper's decimals, `ours` is not what is printed.
bool differs(double ours, double printed);

// Of the noise-free row: how far the paper's own fit (grid_fit.hpp) moves on the same motion when its samples
// are displaced by fractions of a step, and whether the printed values are as good a minimum as where it
// ends.
std::vector<std::string> noise_free_remarks(const CaseMotion& motion, const TableRow& row);

// Of the row with noise: differences in units of the sampling error of two sets of 100 draws; where that is
// not enough, what the paper's procedure, a local search on its grid, gives for the same draws.
std::vector<std::string> scatter_remarks(const CaseMotion& motion, const TableRow& row);

}  // namespace combforce::paper

// What lies beyond the paper: its cases with the bias removed, and whether the error bars of that hold.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/cli/paper/coverage.hpp"
#include "daemon/cli/paper/tables.hpp"
#include "proto/json.hpp"

namespace combforce::paper {

// One of the paper's cases without noise.
struct Unbiased {
  const Case* of = nullptr;
  FitResult partial, refined;  // the paper's fit, and ours
  std::vector<double> bound;   // least standard errors at 300 K in one window (coverage.hpp)
};

struct Beyond {
  std::vector<Unbiased> cases;
  std::vector<Coverage> coverage;
};

// Of each case of the coverage study at most `most_pixels` are drawn, at least 2. On all cores; the same
// numbers on every run. `step` is told what is being done. Throws std::invalid_argument naming value and
// bound.
Beyond look_beyond(std::size_t most_pixels, const std::function<void(std::string_view)>& step);

std::string markdown(const Beyond& beyond);

// {bias: [{case, model, truth, paper, partial, refined, bound}], coverage: [{case, pixels, statuses, …}]}.
// Parameters are objects with the model's own keys; numbers carry 9 significant digits.
Json json(const Beyond& beyond);

}  // namespace combforce::paper

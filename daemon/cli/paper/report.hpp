// The results as Markdown for people and as JSON for programs.
#pragma once

#include <string>

#include "daemon/cli/paper/results.hpp"
#include "proto/json.hpp"

namespace combforce::paper {

std::string markdown(const Results& results);

// {conditions, tables: [{case, model, truth, paper, ours, remarks}], error_maps, force_curves,
// simulator_check, simulator_check_by_rate, motion}. Parameters are objects with the model's own keys;
// numbers carry 9 significant digits.
Json json(const Results& results);

}  // namespace combforce::paper

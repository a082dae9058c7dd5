// The results as Markdown for people and as JSON for programs.
#pragma once

#include <array>
#include <span>
#include <string>
#include <string_view>

#include "daemon/cli/paper/results.hpp"
#include "proto/json.hpp"

namespace combforce::paper {

// Of the parameters, in the order of both models, with their unit.
inline constexpr std::array<std::string_view, 4> parameter_heads{"p0 (nm)", "p1 (GPa nm^1/2)", "p2 (nN)",
                                                                 "p3 (nm)"};

std::string name(const Case& of);  // model and label

Json parameters_json(const Case& of, std::span<const double> values);

std::string markdown(const Results& results);

// {conditions, tables: [{case, model, truth, paper, ours, remarks}], error_maps, force_curves,
// simulator_check, simulator_check_by_rate, motion}. Parameters are objects with the model's own keys;
// numbers carry 9 significant digits.
Json json(const Results& results);

}  // namespace combforce::paper

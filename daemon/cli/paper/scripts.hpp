// The gnuplot scripts of plots/paper, compiled in.
#pragma once

#include <span>
#include <string_view>

namespace combforce::paper {

struct Script {
  std::string_view name;  // without .gp: it draws name.svg from .dat files in its directory
  std::string_view text;
};

std::span<const Script> scripts();         // of the reproduction
std::span<const Script> beyond_scripts();  // of what lies beyond

}  // namespace combforce::paper

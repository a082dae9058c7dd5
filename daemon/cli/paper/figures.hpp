// The paper's figures 2 to 5, and that of the bias removed, as data files, gnuplot scripts and, where gnuplot
// is installed, SVG.
#pragma once

#include <filesystem>
#include <span>

#include "daemon/cli/paper/beyond.hpp"
#include "daemon/cli/paper/results.hpp"
#include "daemon/cli/paper/scripts.hpp"

namespace combforce::paper {

// Each .dat begins with comment lines that name columns and units. Throws std::runtime_error naming the file
// that cannot be written.
void write_data(const std::filesystem::path& directory, const Results& results);
void write_data(const std::filesystem::path& directory, const Beyond& beyond);

enum class Drawing : std::uint8_t { done, no_gnuplot };

// Writes these scripts beside the data and runs gnuplot on each. Throws std::runtime_error naming the script
// on which it fails.
Drawing draw(const std::filesystem::path& directory, std::span<const Script> scripts);

}  // namespace combforce::paper

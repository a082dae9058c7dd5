// Whether the error bars of the refined fit hold: pixels under Langevin forces in the time domain, fitted,
// and compared with what was simulated.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string_view>
#include <vector>

#include "fit/fit_result.hpp"

namespace combforce::paper {

inline constexpr std::uint32_t most_refinements = 30;  // of all refined fits of the studies

struct CoverageCase {
  std::string_view key;                  // in JSON and in names of files
  std::string_view label;                // for people
  std::string_view paper_case;           // key of the case whose drive, model and truth these are (cases.hpp)
  std::vector<std::uint64_t> sidebands;  // bins measured besides the drive's: products of intermodulation
  unsigned windows;                      // contiguous ones averaged in a pixel
  std::size_t pixels;                    // drawn by the whole study
};

// Hertz 2 and 4 tones EE, DMT EE without and with six sidebands, Hertz EA on means of 16 windows, DMT EA.
std::span<const CoverageCase> coverage_cases();

struct ParameterCoverage {
  double truth = 0.0;
  double mean = 0.0, scatter = 0.0;  // of the pixels' parameters; scatter is their standard deviation
  double claimed = 0.0;              // median standard error
  // Least standard error there can be: of an efficient fit to forces with the thermal noise S Delta f in each
  // quadrature, linearised at the truth.
  double bound = 0.0;
  double within_68 = 0.0,
         within_95 = 0.0;  // share of pixels whose interval of that nominal level holds the truth
};

struct Coverage {
  const CoverageCase* of = nullptr;
  std::size_t pixels = 0;
  // How many pixels have each status, FitStatus as the index.
  std::array<std::size_t, static_cast<std::size_t>(FitStatus::ambiguous) + 1> statuses{};
  std::size_t fitted = 0;                     // have parameters and standard errors: what follows is of these
  double chi2_reduced = 0.0;                  // mean
  std::vector<ParameterCoverage> parameters;  // in the model's order
};

// The bound of each parameter.
std::vector<double> least_errors(const CoverageCase& of);

// Simulates and fits `pixels` pixels of a case on all cores; the same numbers on every run. Minutes for a
// thousand pixels. `progress` is called from several threads, one at a time, with the pixels done so far; may
// be empty.
Coverage measure_coverage(const CoverageCase& of, std::size_t pixels,
                          const std::function<void(std::size_t)>& progress = {});

}  // namespace combforce::paper

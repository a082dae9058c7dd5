// Which further tones would sharpen the parameters of a pixel most: for the design of a comb.
#pragma once

#include <complex>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "fit/pixel_fitter.hpp"

namespace combforce {

// What is to be measured: a comb under a drive over a surface of known force.
struct TypicalPixel {
  // As of the pixels to come, with a noise model; the fit is refined. `free_response` is not read.
  FitConditions conditions;
  std::vector<std::complex<double>> drive_forces_nn;  // one a driven tone of the comb
  std::vector<double> parameters;                     // in the model's order
};

struct ToneAdvice {
  struct Step {
    std::uint64_t bin = 0;           // the tone added
    std::vector<double> std_errors;  // of the parameters, with it and all before it
  };
  std::vector<double> std_errors;  // with the comb as it is
  std::vector<Step> steps;         // best first
};

// Simulates the pixel's settled motion and adds to the comb the tones that lower the sum of squares of the
// refined fit's standard errors, each relative to that of the comb, most (A-optimal design): the best one
// after the other, then one in exchange for another as long as that helps. They are chosen to first order in
// the noise (tone_information.hpp); the errors told are those of fits. Detector noise given for every tone
// holds for the candidates nearest to it.
//
// Fits run on all cores; the same advice on any number of them. `progress` is called from several threads,
// one at a time, with the fits done of this choice and how many it has (another choice follows where a fit
// goes astray); may be empty. Throws std::invalid_argument saying what is wrong with the pixel: its drive or
// noise are none, it takes too long to settle or does not, the tip does not touch, the comb has fewer numbers
// than the model parameters, or a fit of the exact tones does not come back.
ToneAdvice advise_tones(const TypicalPixel& pixel, std::size_t tones,
                        const std::function<void(std::size_t, std::size_t)>& progress = {});

}  // namespace combforce

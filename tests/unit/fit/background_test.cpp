#include "fit/background.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <stdexcept>
#include <vector>

#include "tests/unit/fit/paper_cantilever.hpp"

namespace combforce {
namespace {

using test::paper_cantilever;
using test::Phasors;

// Of the same mass, softer by `stiffness` (nN/nm) and damped more by `share` of its damping.
Mode squeezed(const Mode& mode, double stiffness, double share) {
  Mode near = mode;
  near.stiffness_n_per_m -= stiffness;
  near.frequency_hz *= std::sqrt(near.stiffness_n_per_m / mode.stiffness_n_per_m);
  const double damping = mode.stiffness_n_per_m / (mode.frequency_hz * mode.quality_factor) * (1.0 + share);
  near.quality_factor = near.stiffness_n_per_m / (near.frequency_hz * damping);
  return near;
}

Phasors answers(const Cantilever& cantilever, const std::vector<double>& frequencies_hz) {
  Phasors tones;
  for (const double frequency_hz : frequencies_hz)
    tones.push_back(0.1 * tip_response(cantilever, frequency_hz));
  return tones;
}

TEST(Background, FindsTheChangedModes) {
  const Cantilever far = paper_cantilever();
  Cantilever near = far;
  for (std::size_t m = 0; m < 4; ++m)
    near.modes[m] = squeezed(far.modes[m], 1e-4 * far.modes[m].stiffness_n_per_m, 0.02);
  const std::vector<double> frequencies_hz{117e3, 674e3, 1758e3, 3235e3};
  const Cantilever found =
      near_surface(far, frequencies_hz, answers(far, frequencies_hz), answers(near, frequencies_hz));
  for (std::size_t m = 0; m < 4; ++m) {
    // At a mode's resonance the others answer with some percent of it.
    EXPECT_NEAR(found.modes[m].quality_factor / near.modes[m].quality_factor, 1.0, 1e-3) << m;
    EXPECT_NEAR(found.modes[m].frequency_hz / near.modes[m].frequency_hz, 1.0, 1e-5) << m;
    EXPECT_NEAR(found.modes[m].stiffness_n_per_m / near.modes[m].stiffness_n_per_m, 1.0, 2e-5) << m;
  }
}

TEST(Background, LeavesAloneWhatNothingDrives) {
  const Cantilever far = paper_cantilever();
  Cantilever near = far;
  near.modes[0] = squeezed(far.modes[0], 0.0, 0.03);
  const std::vector<double> frequencies_hz{116.5e3, 117e3, 674e3};
  Phasors free = answers(far, frequencies_hz), lifted = answers(near, frequencies_hz);
  free[2] = {1e-5, 0.0};  // noise
  lifted[2] = {0.0, -3e-5};
  const Cantilever found = near_surface(far, frequencies_hz, free, lifted);
  EXPECT_NEAR(found.modes[0].quality_factor / near.modes[0].quality_factor, 1.0, 1e-4);
  for (std::size_t m = 1; m < 4; ++m) EXPECT_EQ(found.modes[m], far.modes[m]);
  const Cantilever same = near_surface(far, frequencies_hz, free, free);
  EXPECT_NEAR(same.modes[0].quality_factor, far.modes[0].quality_factor, 1e-9);
}

TEST(Background, RefusesResponsesToDifferentDrives) {
  const Cantilever far = paper_cantilever();
  const std::vector<double> frequencies_hz{117e3};
  const Phasors free = answers(far, frequencies_hz);
  // Five times the motion in quadrature would take more damping away than there is.
  EXPECT_THROW(near_surface(far, frequencies_hz, free, Phasors{-5.0 * free[0]}), std::invalid_argument);
}

}  // namespace
}  // namespace combforce

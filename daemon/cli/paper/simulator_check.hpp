// The paper's test of its simulator (section 2.2, figure 5): the force recovered from the whole spectrum of
// the motion by equation 7, against the force the simulator used at each time; and how much of the difference
// the end of that spectrum makes.
#pragma once

#include <vector>

#include "daemon/cli/paper/cases.hpp"

namespace combforce::paper {

struct Difference {
  double largest_nn = 0.0;  // of |recovered - used|
  double spread_nn = 0.0;   // its standard deviation over the samples
};

struct SimulatorCheck {
  const Case* of = nullptr;
  std::vector<double> recovered_nn, used_nn;  // one a sample of the motion
  Difference difference;
};

// At the motion's own sample rate, all bins up to half of it.
SimulatorCheck check_simulator(const CaseMotion& motion);

// The same for one motion sampled at several rates. A force with a kink has no spectrum that ends: cut off at
// half the sample rate h^-1 it is wrong by some (jump of dF/dt) h for some h at every crossing, so the
// largest difference falls as h and the standard deviation as h^(3/2). What is left below 100 MHz when the
// spectra reach much higher is the simulator's own error.
struct BandCheck {
  const Case* of = nullptr;
  struct AtRate {
    double sample_rate_hz;
    Difference difference;
  };
  std::vector<AtRate> rates;             // 200, 400, 800, 1600 MHz
  Difference in_band;                    // at 1600 MHz, bins below 100 MHz of both forces
  std::vector<double> in_band_error_nn;  // recovered - used, one a sample at 200 MHz
};
BandCheck check_band(const Case& of);

}  // namespace combforce::paper

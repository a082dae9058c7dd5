// The paper's test of its simulator (section 2.2, figure 5): the force recovered from the whole spectrum of
// the motion by equation 7, against the force the simulator used at each time.
#pragma once

#include <vector>

#include "daemon/cli/paper/cases.hpp"

namespace combforce::paper {

struct SimulatorCheck {
  const Case* of = nullptr;
  std::vector<double> recovered_nn, used_nn;  // one a sample of the motion
  double largest_nn = 0.0;                    // of |recovered - used|
  double spread_nn = 0.0;                     // its standard deviation
};

// All bins up to 100 MHz. What remains is mostly the kinks of the force, which no spectrum that ends can
// have.
SimulatorCheck check_simulator(const CaseMotion& motion);

}  // namespace combforce::paper

// A force linear in the tip's motion that acts before the tip reaches the surface's own forces: squeezed air,
// fields of long range. It changes resonance and damping of the modes between where the free response was
// captured and the surface, and a change of Q by 1 % is many times the noise.
//
// With the same drive, free far away and free when lifted just above the surface,
//     chi^-1 d_free = (chi^-1 - kappa_i) d_lifted
// gives the background's stiffness kappa_i (nN/nm) at every driven tone. Each mode takes over the background
// of the driven tones that it answers most to: stiffness Re kappa and damping Im kappa/w, its mass
// k/(2 pi f)^2 stays.
// Forces are then measured from the lifted response with the changed modes.
#pragma once

#include <complex>
#include <span>

#include "fit/cantilever.hpp"

namespace combforce {

// The cantilever as it is just above the surface. One value a driven tone in each span; tones whose free
// motion is below a thousandth of the greatest, and modes that none drives, change nothing. Throws
// std::invalid_argument when no mode is left that would come to rest: the two responses are not of one drive.
// Reentrant.
Cantilever near_surface(const Cantilever& cantilever, std::span<const double> frequencies_hz,
                        std::span<const std::complex<double>> free_nm,
                        std::span<const std::complex<double>> lifted_nm);

}  // namespace combforce

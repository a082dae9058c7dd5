// Units of the fit: nm, nN, s, Hz, K. Then N/m = nN/nm, GPa = nN/nm^2 and energies are nN nm = 1e-18 J, so
// that everything a solver sees is O(1): with SI values its absolute tolerances stop a fit at once.
#pragma once

namespace combforce {

// Boltzmann's constant, 1.380649e-23 J/K (exact, SI 2019), in nN nm/K.
inline constexpr double boltzmann_nn_nm_per_k = 1.380649e-5;

}  // namespace combforce

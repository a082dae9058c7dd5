// Whole spectra of real signals, double precision.
#pragma once

#include <complex>
#include <span>
#include <vector>

namespace combforce {

// Peak phasors of all bins 0 … N/2 of N samples, N even: x_n = Re sum_k X_k exp(2 pi i k n / N). Reentrant.
std::vector<std::complex<double>> spectrum_of(std::span<const double> signal);

// The N samples that have these N/2 + 1 peak phasors.
std::vector<double> signal_of(std::span<const std::complex<double>> spectrum);

}  // namespace combforce

// Power spectral densities in text files: columns of numbers, and JPK's thermal noise files (.tnd), whose
// header tells the vendor's own fit.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace combforce {

// What the header of a .tnd file says, in our units; what it does not say is absent. The vendor's model is
// S = A^2 f0^4/((f0^2 - f^2)^2 + (f f0/Q)^2) + W, A^2 and W one-sided.
struct VendorFit {
  std::optional<double> frequency_hz, quality_factor, amplitude_v_per_sqrt_hz, floor_v2_per_hz;
  std::optional<double> sensitivity_nm_per_v, stiffness_n_per_m, temperature_k, correction_factor;
};

struct SpectrumFile {
  double first_hz = 0.0, bin_hz = 0.0;
  std::vector<double> density;      // of first_hz + i bin_hz, as it stands in the file
  std::optional<VendorFit> vendor;  // of a .tnd file
};

// Lines that begin with '#' are a header or comments, empty lines are skipped; every other line has the
// frequency (Hz) in column 1 and the density in column `column` >= 2, separated by blanks, tabs, commas or
// semicolons. Frequencies ascend in equal steps (within 2 % of the first), at least 16. Throws InputError
// with file, line, value and bound: unreadable file, no number, missing column, negative or infinite value,
// unequal steps; and, in a .tnd header, a number or unit that is not understood.
SpectrumFile read_spectrum_file(const std::string& path, std::size_t column = 2);
SpectrumFile parse_spectrum(std::string_view text, const std::string& file, std::size_t column = 2);

}  // namespace combforce

// The motion far from the surface: the reference from which a force is measured.
#pragma once

#include <complex>
#include <cstdint>
#include <optional>
#include <vector>

namespace combforce {

struct FreeResponse {
  std::uint64_t first_sample = 0;             // where it was captured
  std::uint64_t windows = 0;                  // averaged; 0 when not known
  std::vector<std::complex<double>> mean_nm;  // tip deflection, one a tone of the comb, phase at sample 0
  // Covariance of the mean, row-major over [re_0, im_0, re_1, im_1, ...], nm^2; absent when not known.
  std::optional<std::vector<double>> covariance;
  bool coherent = true;  // false: it drifted while it was captured; no force can be measured from it
  // The same captured just above the surface, out of reach of the force to be fitted, with the same drive:
  // what FitSettings::background takes its force from. Absent: not captured.
  std::optional<std::vector<std::complex<double>>> lifted_nm = std::nullopt;
  std::uint64_t lifted_windows = 0;  // averaged in it; 0 when not known

  bool operator==(const FreeResponse&) const = default;
};

}  // namespace combforce

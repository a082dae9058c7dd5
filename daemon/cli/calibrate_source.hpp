// Where `combforce calibrate thermal` takes its spectrum from: a file of densities, a recording, or the
// stream of a daemon.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "fit/thermal_fit.hpp"
#include "proto/description.hpp"
#include "proto/spectrum_file.hpp"

namespace combforce {

// A spectrum with what its source knows beside it.
struct ThermalSource {
  std::string name;  // file, for people
  AveragedSpectrum spectrum;
  bool averages_known = true;                         // false: to be found from the scatter
  std::uint64_t segments = 0, gaps = 0, clipped = 0;  // of a stream; clipped samples
  std::vector<std::string> warnings;                  // of a recording
  Description description;          // of a recording and the configuration, which overrides it
  std::optional<VendorFit> vendor;  // of a .tnd file
};

struct SpectrumFileOptions {
  std::size_t column = 2;
  bool two_sided = false;  // the file's density is that of both signs of frequency: doubled
  bool hann = false;      // each periodogram was seen through a Hann window of one over the step of frequency
  double averages = 0.0;  // 0: from the scatter
};
ThermalSource read_density(const std::string& path, const SpectrumFileOptions& options);

// Channel 0 of a recording, in volts, by Welch's method. segment_samples 0: the power of two that makes bins
// at most 1/30 as wide as pi f0/Q of the narrowest of `modes`: segments of 30 ring-downs.
struct StreamOptions {
  std::size_t segment_samples = 0;
  bool verify = true;  // core:sha512
};
ThermalSource read_stream(const std::string& recording, const Description& configured,
                          const std::vector<OscillatorStart>& modes, const StreamOptions& options);

// Has the daemon record `seconds` of its stream, and waits; the path of the recording, which the daemon
// writes: a daemon elsewhere must share the file system. An interrupt ends the recording and throws.
std::string record_live(const std::string& connect, double seconds);

}  // namespace combforce

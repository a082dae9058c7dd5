// What `combforce calibrate thermal` found, as text, JSON, calibration file and table for a plot.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "daemon/cli/calibrate_source.hpp"
#include "fit/thermal_calibration.hpp"
#include "proto/calibration.hpp"

namespace combforce {

// One fit with the bins it used; several modes when they were fitted jointly.
struct BandFit {
  ThermalFitSettings settings;
  ThermalFit fit;
  // Of ln P of its first mode, against fits over bands 2/3 and 4/3 as wide: how far a model that does not
  // describe the spectrum leads astray. Absent when the band was given.
  std::optional<double> band_spread;
};

struct ThermalResult {
  ThermalSource source;
  std::vector<BandFit> fits;  // in the order of modes
  CalibrationSettings settings;
  std::optional<Cantilever> calibrated;            // absent: neither sensitivity nor stiffness was known
  std::optional<double> vendor_stiffness_n_per_m;  // from the vendor's fit by our formula
};

std::string report_text(const ThermalResult& result);
Json report_json(const ThermalResult& result);
std::vector<std::string> warnings(const ThermalResult& result);

// Of a result that is calibrated. Detector noise: the floor of the lowest mode that tells it to 30 %, else of
// the one that tells it best.
Calibration calibration_of(const ThermalResult& result);

// Rows f, S, model, S/model - 1 averaged over as many bins as make the last's scatter 5 %, and that scatter;
// two blank lines between fits. For plots/thermal.gp.
void write_table(const ThermalResult& result, const std::string& path);

}  // namespace combforce

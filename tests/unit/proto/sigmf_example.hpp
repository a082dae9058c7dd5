// A recording's metadata that uses all of the extension: a gap, a new epoch, a change, lines with and without
// indices of their own, and keys of others.
#pragma once

#include <string>

#include "proto/json.hpp"

namespace combforce {

inline const std::string example_file = "rec.sigmf-meta";

inline const std::string sigmf_example_text = R"({
  "global": {
    "core:datatype": "ri16_le", "core:version": "1.2.5", "core:sample_rate": 1e6, "core:num_channels": 2,
    "core:sha512": ")" + std::string(128, 'a') +
                                              R"(",
    "core:extensions": [{"name": "afm", "version": "0.1.0", "optional": true}],
    "core:recorder": "someone", "core:description": "a scan",
    "afm:channels": [{"name": "deflection", "role": "deflection", "unit": "V", "scale": 1e-4, "offset": 0.0},
                     {"name": "z", "role": "z", "unit": "nm", "scale": 0.01, "offset": 0.0}],
    "afm:cantilever": {"modes": [{"frequency_hz": 117e3, "quality_factor": 212, "stiffness_n_per_m": 4,
                                  "sensitivity_nm_per_v": 1.0}]},
    "afm:comb": {"window_samples": 100, "tones": [{"bin": 11, "driven": true}, {"bin": 12, "driven": false}]},
    "afm:scan": {"lines": 4, "columns": 10, "pixel_samples": 200, "settle_samples": 100, "windows": 1,
                 "bidirectional": true, "size_nm": [100.0, 40.0]},
    "afm:noise": {"temperature_k": 300, "detector_nm_per_sqrt_hz": 1e-4},
    "afm:fit": {"model": "hertz", "refine": 0, "weighting": "none", "profile_intervals": false,
      "calibration_errors": false, "background": "none", "compare": [], "bounds": {}},
    "afm:truth": {"file": "REC.truth.ndjson"}
  },
  "captures": [
    {"core:sample_start": 0, "core:global_index": 1000, "core:datetime": "2026-01-02T03:04:05Z"},
    {"core:sample_start": 3000, "core:global_index": 4500},
    {"core:sample_start": 4000, "core:global_index": 5500, "afm:steps": [5500],
     "afm:free_response": {"first_sample": 100, "windows": 1, "mean_nm": [[1.0, 2.0], [0.0, -1.5]]}},
    {"core:sample_start": 6000, "core:global_index": 10000, "afm:epoch": 1, "afm:epoch_reason": "unknown_loss",
     "afm:scan_ends": [10000, 10500], "afm:free_response": null}
  ],
  "annotations": [
    {"core:sample_start": 0, "core:sample_count": 2000, "core:label": "line", "afm:line": 0, "afm:frame": 0,
     "afm:direction": "trace", "afm:first_sample": 1000, "afm:line_samples": 2000},
    {"core:sample_start": 50, "core:comment": "a fly"},
    {"core:sample_start": 2500, "core:sample_count": 1000, "core:label": "line", "afm:line": 0, "afm:frame": 2,
     "afm:direction": "retrace", "afm:first_sample": 3400, "afm:line_samples": 2000},
    {"core:sample_start": 6000, "core:sample_count": 0, "core:label": "line", "afm:line": 3, "afm:frame": 0,
     "afm:direction": "trace", "afm:first_sample": 7700, "afm:line_samples": 2000}
  ]
})";

inline Json sigmf_example() {
  return parse_json(sigmf_example_text, "example");
}

}  // namespace combforce

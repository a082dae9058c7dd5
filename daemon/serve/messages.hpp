// What the daemon says about itself and its stream, as JSON (message contract). Pixels:
// proto/pixel_message.hpp.
#pragma once

#include <string>

#include "daemon/instrument.hpp"
#include "proto/json.hpp"

namespace combforce {

inline constexpr int protocol_version = 1;  // instrument.info.protocol

// {frame, line, direction, first_sample, line_samples, counts}
Json encode(const LineDone& line);
// {frame, counts}; counts: {pixels, status: {converged: …, …}, settling_residual}
Json encode(const FrameDone& frame);
// {kind, first_sample, count, text}
Json encode(const Event& event);
// {first_sample, samples, segments, bin_hz, unit, density: [of bin 0, of bin 1, …]}
Json encode(const Spectrum& spectrum);
// {sample, utc, uncertainty_s, state, …}: the result of instrument.status and the `status` notification.
Json encode(const InstrumentStatus& status);
// {meta_path, first_sample, frames, gaps, lost_frames, complete, failure}
Json encode(const RecordingSummary& summary);
// The result of instrument.info: {name, version, protocol, sample_rate_hz, the description's objects, models,
// digitizer}
Json encode_info(const StreamInfo& info, const Description& description);
// The result of model.list: [{name, formula, source, parameters: [{name, lower, upper}]}]
Json encode_models();

// {"jsonrpc":"2.0","method":…,"params":…} and a newline.
std::string notification_line(std::string_view method, const Json& params);

}  // namespace combforce

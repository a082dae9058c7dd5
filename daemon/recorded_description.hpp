// What a recording says of its samples, under a configuration.
#pragma once

#include <vector>

#include "daemon/pipeline/pipeline.hpp"
#include "proto/description.hpp"
#include "proto/sigmf.hpp"

namespace combforce {

// `configured` where it says something, else `recorded`. The free response and the detector's noise that the
// recording alone tells were volts: they become what the configured cantilever or channel makes of these
// (where the recording describes neither, they stay), at the tones of the configured comb. Tones are known by
// their frequency; where one was not recorded there is no free response, and the noise is that of the
// nearest.
Description under_configuration(const Description& recorded, const Description& configured,
                                double sample_rate_hz);

// What the captures of a recording change along the stream, each with the whole description in force from
// there on.
std::vector<ScheduledChange> changes_of(const SigmfMeta& meta, const Description& configured);

}  // namespace combforce

#include "daemon/serve/messages.hpp"

#include <array>
#include <cmath>
#include <string_view>

#include "daemon/serve/rpc.hpp"
#include "fit/force_model.hpp"
#include "proto/pixel_message.hpp"

namespace combforce {

namespace {

Json encode(const PixelCounts& counts) {
  Json status = Json::object();
  for (std::size_t i = 0; i < counts.by_status.size(); ++i) {
    status[std::string(to_string(static_cast<FitStatus>(i)))] = counts.by_status[i];
  }
  return {{"pixels", counts.pixels},
          {"status", status},
          {"settling_residual", number9(counts.settling_residual)}};
}

std::string_view to_string(StreamState state) {
  constexpr std::array<std::string_view, 4> names{"idle", "running", "ended", "failed"};
  return names[static_cast<std::size_t>(state)];
}

// Bounds as JSON has them: what is not finite is null.
Json bound(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}

}  // namespace

Json encode(const LineDone& line) {
  return {{"frame", line.mark.frame},
          {"line", line.mark.line},
          {"direction", to_string(line.mark.direction)},
          {"first_sample", line.mark.first_sample},
          {"line_samples", line.mark.line_samples},
          {"counts", encode(line.counts)}};
}

Json encode(const FrameDone& frame) {
  return {{"frame", frame.frame}, {"counts", encode(frame.counts)}, {"whole", frame.whole}};
}

Json encode(const Event& event) {
  return {{"kind", event.kind},
          {"first_sample", event.first_sample},
          {"count", event.count},
          {"text", event.text}};
}

Json encode(const Spectrum& spectrum) {
  Json density = Json::array();
  for (const double value : spectrum.density) density.push_back(number9(value));
  return {{"first_sample", spectrum.first_sample},
          {"samples", spectrum.samples},
          {"segments", spectrum.segments},
          {"bin_hz", number9(spectrum.bin_hz)},
          {"unit", spectrum.unit},
          {"density", std::move(density)}};
}

Json encode(const RecordingSummary& summary) {
  return {{"meta_path", summary.meta_path},     {"first_sample", summary.first_sample},
          {"frames", summary.frames},           {"gaps", summary.gaps},
          {"lost_frames", summary.lost_frames}, {"complete", summary.complete},
          {"failure", summary.failure}};
}

Json encode(const InstrumentStatus& status) {
  Json message{{"sample", status.sample},
               {"utc", status.utc},
               {"uncertainty_s", number9(status.uncertainty_s)},
               {"state", to_string(status.stream.state)},
               {"reason", status.stream.reason},
               {"epoch", status.stream.epoch},
               {"scanning", status.stream.scanning},
               {"realtime_factor", number9(status.stream.realtime_factor)},
               {"lost_frames", status.stream.lost_frames},
               {"dropped_extraction", status.dropped_extraction},
               {"dropped_recorder", status.dropped_recorder},
               {"pixels_extracted", status.pipeline.pixels_extracted},
               {"pixels_retired", status.pipeline.pixels_retired},
               {"not_fitted", status.pipeline.not_fitted},
               {"extraction_busy", number9(status.pipeline.extraction_busy)},
               {"threads", status.pipeline.threads},
               {"recording", status.recording}};
  message["record"] = status.record.meta_path.empty() ? Json(nullptr) : encode(status.record);
  return message;
}

Json encode_models() {
  Json models = Json::array();
  for (const ModelInfo& model : force_models()) {
    Json parameters = Json::array();
    for (const ParameterInfo& p : model.parameters) {
      parameters.push_back({{"name", p.name}, {"lower", bound(p.lower)}, {"upper", bound(p.upper)}});
    }
    models.push_back({{"name", model.name},
                      {"formula", model.formula},
                      {"source", model.source},
                      {"parameters", parameters}});
  }
  return models;
}

Json encode_info(const StreamInfo& info, const Description& description) {
  Json message{{"name", "combforced"},
               {"version", COMBFORCE_VERSION},
               {"protocol", protocol_version},
               {"sample_rate_hz", info.sample_rate_hz}};
  encode_into(message, description, "");
  message["models"] = encode_models();
  message["digitizer"] = {{"name", info.name},
                          {"format", info.format == SampleFormat::i16 ? "i16" : "f32"},
                          {"block_frames", info.block_frames},
                          {"can_wait", info.when_full == WhenFull::wait},
                          {"marks_lines", info.marks_lines},
                          {"has_scanner", info.has_scanner},
                          {"has_drive", info.has_drive},
                          {"continuity_verifiable", info.continuity_verifiable}};
  return message;
}

std::string notification_line(std::string_view method, const Json& params) {
  return message_line({{"jsonrpc", "2.0"}, {"method", method}, {"params", params}});
}

}  // namespace combforce

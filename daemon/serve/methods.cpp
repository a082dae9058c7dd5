#include "daemon/serve/methods.hpp"

#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/serve/messages.hpp"
#include "proto/description.hpp"

namespace combforce {

namespace {

constexpr std::uint64_t max_u32 = std::numeric_limits<std::uint32_t>::max();
constexpr std::uint64_t max_index = (std::uint64_t{1} << 53) - 1;  // samples in messages stay below 2^53

Json object_schema(Json properties, Json required = Json::array()) {
  Json schema{{"type", "object"}, {"properties", std::move(properties)}};
  if (!required.empty()) schema["required"] = std::move(required);
  schema["additionalProperties"] = false;
  return schema;
}

Json nothing() {
  return object_schema(Json::object());
}
Json any_object() {
  return {{"type", "object"}};
}

Json integer(std::uint64_t minimum, std::uint64_t maximum, const char* description) {
  return {{"type", "integer"}, {"minimum", minimum}, {"maximum", maximum}, {"description", description}};
}

Json names(std::vector<std::string_view> allowed, const char* description) {
  return {{"type", "string"}, {"enum", std::move(allowed)}, {"description", description}};
}

Json typed(const char* type, const char* description) {
  return {{"type", type}, {"description", description}};
}

Json list_of(Json items, const char* description) {
  return {{"type", "array"}, {"items", std::move(items)}, {"description", description}};
}

void add_instrument(RpcTable& table, Instrument& instrument) {
  table.add({"instrument.info", "What this instrument is and what is configured.", nothing(), any_object(),
             RpcHandler([&instrument](const JsonView&, Subscriptions&) {
               return encode_info(instrument.info(), instrument.description());
             })});
  table.add({"instrument.status", "Where the stream stands, what was lost, what is running.", nothing(),
             any_object(), RpcHandler([&instrument](const JsonView&, Subscriptions&) {
               return encode(instrument.status());
             })});
}

Json scan_schema() {
  return object_schema(
      {{"frames", integer(0, max_u32, "frames to scan, 0: until stopped; default 1")},
       {"lines", integer(1, most_pixels_a_side, "absent, like the rest: as configured")},
       {"columns", integer(1, most_pixels_a_side, "pixels a line")},
       {"pixel_samples", integer(1, max_index, "samples a pixel")},
       {"settle_samples", integer(0, max_index, "skipped at the start of a pixel, at least")},
       {"windows", integer(1, max_u32, "comb windows averaged in a pixel")},
       {"bidirectional", typed("boolean", "trace and retrace")},
       {"size_nm", {{"type", "array"}, {"items", {{"type", "number"}}}, {"minItems", 2}, {"maxItems", 2}}}});
}

// The configured layout with what the request says instead; empty when it says nothing.
std::optional<ScanLayout> requested_layout(const JsonView& params,
                                           const std::optional<ScanLayout>& configured) {
  Json layout = configured ? encode(*configured) : Json::object();
  bool said = false;
  for (const auto& item : params.json().items()) {
    if (item.key() == "frames") continue;
    layout[item.key()] = item.value();
    said = true;
  }
  if (!said) return std::nullopt;
  static const std::string no_file;
  return decode_scan(JsonView(layout, no_file));
}

void add_scanner(RpcTable& table, Instrument& instrument) {
  table.add({"scan.start", "Scan with the given raster, or as configured.", scan_schema(), any_object(),
             RpcHandler([&instrument](const JsonView& params, Subscriptions&) -> Json {
               const auto layout = requested_layout(params, instrument.configured_scan());
               const auto frames = params.find("frames");
               instrument.start_scan(layout,
                                     frames ? static_cast<std::uint32_t>(frames->integer(0, max_u32)) : 1);
               return {{"scanning", true}};
             })});
  table.add({"scan.stop", "End the scan; the instrument goes on measuring the free motion.", nothing(),
             any_object(), RpcHandler([&instrument](const JsonView&, Subscriptions&) -> Json {
               instrument.stop_scan();
               return {{"scanning", false}};
             })});
}

void add_line_marks(RpcTable& table, Instrument& instrument) {
  table.add({"scan.line", "A scan line lies at these samples of the stream; say so before it begins.",
             object_schema({{"frame", integer(0, max_u32, "default 0")},
                            {"line", integer(0, max_u32, "spatial row")},
                            {"direction", names({"trace", "retrace"}, "default trace")},
                            {"first_sample", integer(0, max_index, "index in the stream")},
                            {"line_samples", integer(1, max_index, "length")}},
                           {"line", "first_sample", "line_samples"}),
             any_object(), RpcHandler([&instrument](const JsonView& params, Subscriptions&) -> Json {
               LineMark mark;
               if (const auto frame = params.find("frame"))
                 mark.frame = static_cast<std::uint32_t>(frame->integer());
               mark.line = static_cast<std::uint32_t>(params.get("line").integer());
               if (const auto direction = params.find("direction")) {
                 mark.direction =
                     direction->one_of({"trace", "retrace"}) == 0 ? Direction::trace : Direction::retrace;
               }
               mark.first_sample = params.get("first_sample").integer();
               mark.line_samples = params.get("line_samples").integer();
               instrument.mark_line(mark);
               return Json::object();
             })});
}

void add_recording(RpcTable& table, Instrument& instrument) {
  table.add({"record.start",
             "Record the stream as NAME.sigmf-data and NAME.sigmf-meta in the configured directory.",
             object_schema({{"name",
                             {{"type", "string"},
                              {"minLength", 1},
                              {"maxLength", 200},
                              {"pattern", "^[A-Za-z0-9_][A-Za-z0-9_.-]*$"},
                              {"description", "absent: from the time"}}}}),
             any_object(), RpcHandler([&instrument](const JsonView& params, Subscriptions&) -> Json {
               const auto name = params.find("name");
               return {{"meta_path", instrument.start_recording(name ? name->string() : "")}};
             })});
  table.add({"record.stop", "End the recording; the result sums it up.", nothing(), any_object(),
             RpcHandler([&instrument](const JsonView&, Subscriptions&) {
               return encode(instrument.stop_recording());
             })});
}

void add_free_capture(RpcTable& table, Instrument& instrument,
                      std::function<void(std::function<void()>)> post) {
  const auto asked = std::make_shared<const Subscriptions*>(nullptr);  // who asked for the last capture
  auto capture = [&instrument, asked, post = std::move(post)](
                     const JsonView& params, const Subscriptions& caller, const RpcRespond& respond) {
    const auto windows = params.find("windows"), lifted = params.find("lifted");
    instrument.capture_free(
        windows ? static_cast<std::uint32_t>(windows->integer()) : 16,
        lifted && lifted->boolean() ? Instrument::Height::lifted : Instrument::Height::far,
        [post, respond](const std::optional<FreeResponse>& response, const std::string& why) {
          RpcResult result =
              why.empty() ? RpcResult(encode(*response)) : RpcError{rpc_instrument_error, why, nullptr};
          post([respond, result = std::move(result)] { respond(result); });
        });
    *asked = &caller;
  };
  auto cancel_for = [&instrument, asked](const Subscriptions& caller) {
    if (*asked != &caller) return;
    *asked = nullptr;
    instrument.cancel_free();
  };
  table.add(
      {"free.capture",
       "Average the free motion: the reference from which forces are measured. Answers when done. An error "
       "says that there is none, or that it drifts: pixels are flagged incoherent until it is captured "
       "again. Given up when the client that asked disconnects.",
       object_schema(
           {{"windows", integer(1, 1000000, "comb windows to average; default 16")},
            {"lifted",
             typed("boolean", "captured just above the surface, beside the one far away, after it")}}),
       any_object(), RpcDeferredHandler(std::move(capture)), std::move(cancel_for)});
  table.add({"free.cancel", "Give up the capture of the free motion that is under way, whoever asked for it.",
             nothing(), any_object(), RpcHandler([&instrument](const JsonView&, Subscriptions&) -> Json {
               instrument.cancel_free();
               return Json::object();
             })});
}

void add_drive(RpcTable& table, Instrument& instrument) {
  table.add(
      {"drive.get", "The drive in force.", nothing(), any_object(),
       RpcHandler([&instrument](const JsonView&, Subscriptions&) { return encode(instrument.drive()); })});
  table.add({"drive.set", "Another drive, from the next pixel on; what is absent takes its default.",
             object_schema(
                 {{"scheme", names({"equal_energy", "equal_amplitude", "amplitudes"}, "free amplitudes")},
                  {"total_amplitude_nm", typed("number", "sum of the free amplitudes")},
                  {"amplitudes_nm", list_of({{"type", "number"}}, "scheme amplitudes: one a driven tone")},
                  {"phases_rad", list_of({{"type", "number"}}, "of the forces at sample 0")}}),
             any_object(), RpcHandler([&instrument](const JsonView& params, Subscriptions&) {
               instrument.set_drive(decode_drive(params));
               return encode(instrument.drive());
             })});
}

Json model_names() {
  Json names_of_models = Json::array();
  for (const ModelInfo& model : force_models()) names_of_models.push_back(model.name);
  return names_of_models;
}

void add_model(RpcTable& table, Instrument& instrument) {
  table.add({"model.list", "The force models there are, and the fit in force.", nothing(), any_object(),
             RpcHandler([&instrument](const JsonView&, Subscriptions&) -> Json {
               const auto fit = instrument.description().fit;
               return {{"models", encode_models()}, {"fit", fit ? encode(*fit) : Json(nullptr)}};
             })});
  table.add(
      {"model.set", "Another fit, from the next pixel on; what is absent takes its default.",
       object_schema({{"model", {{"type", "string"}, {"enum", model_names()}}},
                      {"refine", integer(0, max_u32, "0: the paper's partial motion")},
                      {"weighting", names({"none", "noise"}, "of the residuals")},
                      {"profile_intervals", typed("boolean", "of refined fits, beside standard errors")},
                      {"calibration_errors", typed("boolean", "by the uncertainty of the cantilever")},
                      {"background", names({"none", "linear"}, "linear: removed by the lifted response")},
                      {"compare", list_of({{"type", "string"}, {"enum", model_names()}}, "further models")},
                      {"bounds", typed("object", "{parameter: [lower, upper]}")},
                      {"tip", typed("object", "its geometry, for material parameters")}},
                     {"model"}),
       any_object(), RpcHandler([&instrument](const JsonView& params, Subscriptions&) {
         const FitSettings fit = decode_fit(params);
         instrument.set_fit(fit);
         return encode(fit);
       })});
}

void set_topics(const JsonView& list, Subscriptions& caller, bool on) {
  for (const JsonView& topic : list.elements()) {
    for (std::size_t i = 0; i < topic_names.size(); ++i) {
      if (topic.json() == topic_names[i]) caller.topics[i] = on;
    }
  }
}

Json encode(const Subscriptions& subscriptions) {
  Json topics = Json::array();
  for (std::size_t i = 0; i < topic_names.size(); ++i) {
    if (subscriptions.topics[i]) topics.push_back(topic_names[i]);
  }
  return {{"topics", topics},
          {"tones", subscriptions.tones},
          {"every", subscriptions.every},
          {"spectrum_hz", subscriptions.spectrum_hz}};
}

void add_subscriptions(RpcTable& table) {
  const Json topics =
      list_of(names({topic_names.begin(), topic_names.end()}, "notification"), "what to be told of");
  table.add({"subscribe",
             "Be sent notifications from now on: those named here besides those subscribed to before.",
             object_schema({{"topics", topics},
                            {"tones", typed("boolean", "pixels with their tones; default true")},
                            {"every", integer(1, max_index, "every n-th pixel; default 1")},
                            {"spectrum_hz",
                             {{"type", "number"},
                              {"minimum", SpectrumMonitor::least_hz},
                              {"maximum", SpectrumMonitor::most_hz},
                              {"description", "spectra of the deflection a second; default 1"}}}},
                           {"topics"}),
             any_object(), RpcHandler([](const JsonView& params, Subscriptions& caller) {
               set_topics(params.get("topics"), caller, true);
               const auto tones = params.find("tones");
               caller.tones = tones ? tones->boolean() : true;
               const auto every = params.find("every");
               caller.every = every ? every->integer(1) : 1;
               const auto spectrum_hz = params.find("spectrum_hz");
               caller.spectrum_hz = spectrum_hz ? spectrum_hz->number(positive) : 1.0;
               return encode(caller);
             })});
  table.add({"unsubscribe", "No longer be sent these notifications.",
             object_schema({{"topics", topics}}, {"topics"}), any_object(),
             RpcHandler([](const JsonView& params, Subscriptions& caller) {
               set_topics(params.get("topics"), caller, false);
               return encode(caller);
             })});
}

}  // namespace

void add_methods(RpcTable& table, Instrument& instrument, std::function<void(std::function<void()>)> post) {
  const StreamInfo& info = instrument.info();
  add_instrument(table, instrument);
  if (info.has_scanner) add_scanner(table, instrument);
  if (!info.marks_lines) add_line_marks(table, instrument);
  add_recording(table, instrument);
  add_free_capture(table, instrument, std::move(post));
  if (info.has_drive) add_drive(table, instrument);
  add_model(table, instrument);
  add_subscriptions(table);
}

}  // namespace combforce

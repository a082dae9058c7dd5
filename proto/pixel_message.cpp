#include "proto/pixel_message.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include "proto/json.hpp"

namespace combforce {
namespace {

constexpr std::array<std::string_view, 10> status_names = {
    "converged",        "not_converged", "at_bound", "ill_conditioned", "no_contact",
    "no_free_response", "not_fitted",    "flagged",  "misfit",          "ambiguous"};

constexpr std::array<std::pair<PixelFlag, std::string_view>, 6> all_flags = {
    {{PixelFlag::gap, "gap"},
     {PixelFlag::clipped, "clipped"},
     {PixelFlag::settling, "settling"},
     {PixelFlag::incomplete, "incomplete"},
     {PixelFlag::incoherent, "incoherent"},
     {PixelFlag::sync, "sync"}}};

template <typename... Args>
void append(std::string& out, fmt::format_string<Args...> format, Args&&... args) {
  fmt::format_to(std::back_inserter(out), format, std::forward<Args>(args)...);
}

void append_number(std::string& out, double value) {
  if (std::isfinite(value)) {
    append(out, "{:.9g}", value);
  } else {
    out += "null";
  }
}

// "key": of a name from outside, escaped.
void append_key(std::string& out, const std::string& key) {
  out += Json(key).dump();
  out += ':';
}

// Calls `item(element)` for each, with commas between.
template <typename Range, typename Item>
void append_list(std::string& out, const Range& range, Item item) {
  bool first = true;
  for (const auto& element : range) {
    if (!first) out += ',';
    first = false;
    item(element);
  }
}

void append_position(std::string& out, const Pixel& pixel) {
  append(out, R"("frame":{},"line":{},"column":{},"direction":"{}","first_sample":{},"flags":[)",
         pixel.span.frame, pixel.span.line, pixel.span.column, to_string(pixel.span.direction),
         pixel.span.first_sample);
  append_list(out, flag_names(pixel.flags), [&](std::string_view name) { append(out, R"("{}")", name); });
  out += ']';
}

void append_channels(std::string& out, const PixelMessage& message) {
  out += R"(,"channels":{)";
  const std::size_t channels = std::min(message.channels.size(), message.pixel.channel_means.size());
  for (std::size_t i = 1; i < channels; ++i) {
    if (i > 1) out += ',';
    append_key(out, channel_key(message.channels[i]));
    append_number(out, message.pixel.channel_means[i]);
  }
  out += '}';
}

void append_tones(std::string& out, const PixelMessage& message) {
  out += R"(,"tones":{"bin":[)";
  append_list(out, message.comb.tones, [&](const Tone& tone) { append(out, "{}", tone.bin); });
  out += R"(],"re_nm":[)";
  append_list(out, message.tip_nm, [&](std::complex<double> phasor) { append_number(out, phasor.real()); });
  out += R"(],"im_nm":[)";
  append_list(out, message.tip_nm, [&](std::complex<double> phasor) { append_number(out, phasor.imag()); });
  out += "]}";
}

bool nothing_known(std::span<const double> values) {
  return std::ranges::all_of(values, [](double value) { return std::isnan(value); });
}

// {"parameter": value, …}, or null when nothing is known.
void append_by_parameter(std::string& out, const ModelInfo& model, std::span<const double> values) {
  if (nothing_known(values)) {
    out += "null";
    return;
  }
  out += '{';
  for (std::size_t i = 0; i < values.size(); ++i) {
    append(out, R"({}"{}":)", i > 0 ? "," : "", model.parameters[i].name);
    append_number(out, values[i]);
  }
  out += '}';
}

// "intervals": {"parameter": [lower, upper], …}.
void append_intervals(std::string& out, const ModelInfo& model,
                      std::span<const std::array<double, 2>> intervals) {
  out += R"(,"intervals":{)";
  for (std::size_t i = 0; i < intervals.size(); ++i) {
    append(out, R"({}"{}":[)", i > 0 ? "," : "", model.parameters[i].name);
    append_list(out, intervals[i], [&](double end) { append_number(out, end); });
    out += ']';
  }
  out += '}';
}

void append_comparison(std::string& out, const FitResult& fit) {
  out += R"(,"aicc":)";
  append_number(out, fit.aicc);
  out += R"(,"compared":{)";
  append_list(out, std::span(fit.compared).first(fit.compared_count), [&](const ComparedModel& other) {
    append(out, R"("{}":{{"status":"{}","chi2_reduced":)", other.model->name, to_string(other.status));
    append_number(out, other.chi2_reduced);
    out += R"(,"aicc":)";
    append_number(out, other.aicc);
    out += '}';
  });
  out += '}';
}

void append_material(std::string& out, const MaterialParameters& material) {
  out += R"(,"material":{)";
  bool first = true;
  for (const auto& [name, value] : quantities(material)) {
    if (!value) continue;
    append(out, R"({}"{}":)", first ? "" : ",", name);
    append_number(out, *value);
    first = false;
  }
  if (material.theory) append(out, R"(,"adhesion_theory":"{}")", to_string(*material.theory));
  out += '}';
}

void append_fit(std::string& out, const ModelInfo* model, const FitResult& fit, const TipGeometry* tip) {
  if (model == nullptr) {
    append(out, R"(,"fit":{{"model":null,"status":"{}"}})", to_string(fit.status));
    return;
  }
  append(out, R"(,"fit":{{"model":"{}","status":"{}","refinements":{},"iterations":{},"chi2_reduced":)",
         model->name, to_string(fit.status), fit.refinements, fit.iterations);
  append_number(out, fit.chi2_reduced);
  const std::size_t count = std::min<std::size_t>(fit.parameters_count, model->parameters.size());
  out += R"(,"parameters":)";
  append_by_parameter(out, *model, {fit.parameters.data(), count});
  out += R"(,"std_errors":)";
  append_by_parameter(out, *model, {fit.std_errors.data(), count});
  if (std::ranges::any_of(fit.intervals, [](const auto& ends) { return !nothing_known(ends); }))
    append_intervals(out, *model, {fit.intervals.data(), count});
  if (!nothing_known(fit.calibration_errors)) {
    out += R"(,"calibration_errors":)";
    append_by_parameter(out, *model, {fit.calibration_errors.data(), count});
  }
  out += R"(,"correlation":)";
  const std::span<const double> correlation(fit.correlation.data(),
                                            count * (count - (count > 0 ? 1 : 0)) / 2);
  if (nothing_known(correlation)) {
    out += "null";
  } else {
    out += '[';
    append_list(out, correlation, [&](double value) { append_number(out, value); });
    out += ']';
  }
  if (std::isfinite(fit.alternative_delta_chi2)) {
    out += R"(,"alternative":{"delta_chi2":)";
    append_number(out, fit.alternative_delta_chi2);
    out += R"(,"parameters":)";
    append_by_parameter(out, *model, {fit.alternative.data(), count});
    out += '}';
  }
  if (fit.compared_count > 0) append_comparison(out, fit);
  out += R"(,"virial_nn_nm":)";
  append_number(out, fit.virial_nn_nm);
  out += R"(,"dissipated_fw":)";
  append_number(out, fit.dissipated_fw);
  const std::span<const double> parameters(fit.parameters.data(), count);
  if (tip != nullptr && count > 0 && !nothing_known(parameters))
    append_material(out, material_of(*model, parameters, *tip));
  out += '}';
}

}  // namespace

std::string channel_key(const Channel& channel) {
  return channel.name + (channel.unit == "V" ? "_v" : "_" + channel.unit);
}

void append_pixel_line(std::string& out, const PixelMessage& message, PixelFields fields) {
  out += R"({"jsonrpc":"2.0","method":"pixel","params":{)";
  append_position(out, message.pixel);
  append_channels(out, message);
  if (fields != PixelFields::fit) append_tones(out, message);
  if (fields != PixelFields::tones) append_fit(out, message.model, message.fit, message.tip);
  out += "}}\n";
}

std::string_view to_string(FitStatus status) {
  return status_names[static_cast<std::size_t>(status)];
}

std::string_view to_string(Direction direction) {
  return direction == Direction::trace ? "trace" : "retrace";
}

std::vector<std::string_view> flag_names(PixelFlags flags) {
  std::vector<std::string_view> names;
  for (const auto& [flag, name] : all_flags)
    if (flags.has(flag)) names.push_back(name);
  return names;
}

}  // namespace combforce

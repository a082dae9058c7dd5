#include "proto/description.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "fit/force_model.hpp"
#include "fit/model_list.hpp"

namespace combforce {
namespace {

template <typename T>
void overlay_one(std::optional<T>& base, const std::optional<T>& top) {
  if (top) base = top;
}

template <typename T, typename Decode>
void decode_one(std::optional<T>& target, const JsonView& object, std::string_view prefix,
                std::string_view key, UnknownKeys unknown, Decode decode) {
  if (const auto member = object.find(fmt::format("{}{}", prefix, key))) target = decode(*member, unknown);
}

template <typename T>
void encode_one(Json& object, const std::optional<T>& source, std::string_view prefix, std::string_view key) {
  if (source) object[fmt::format("{}{}", prefix, key)] = encode(*source);
}

// What some models cannot do.
std::optional<Contradiction> find_contradiction(const FitSettings& fit) {
  for (const std::string& model : models_of(fit))
    if (const std::string_view why = why_partial_fit_only(find_model(model)); fit.refine > 0 && !why.empty())
      return Contradiction{"/fit/refine",
                           fmt::format("is {}, must be 0 for model \"{}\": {}", fit.refine, model, why)};
  if (fit.calibration_errors && depends_on_history(find_model(fit.model)))
    return Contradiction{
        "/fit/calibration_errors",
        fmt::format("is true, must be false for model \"{}\": its force depends on history", fit.model)};
  return std::nullopt;
}

}  // namespace

Description overlay(Description base, const Description& top) {
  overlay_one(base.channels, top.channels);
  overlay_one(base.cantilever, top.cantilever);
  overlay_one(base.excitation, top.excitation);
  overlay_one(base.comb, top.comb);
  overlay_one(base.free_response, top.free_response);
  overlay_one(base.scan, top.scan);
  overlay_one(base.noise, top.noise);
  overlay_one(base.fit, top.fit);
  return base;
}

std::optional<Contradiction> find_contradiction(const Description& description) {
  if (description.excitation && description.cantilever && !description.excitation->participation.empty() &&
      description.excitation->participation.size() != description.cantilever->modes.size())
    return Contradiction{
        "/excitation/participation",
        fmt::format("has {} elements, must have {}, one a mode of the cantilever",
                    description.excitation->participation.size(), description.cantilever->modes.size())};
  if (description.fit)
    if (const auto fault = find_contradiction(*description.fit)) return fault;
  if (description.fit && description.fit->calibration_errors && description.cantilever &&
      description.cantilever->uncertainty.empty())
    return Contradiction{"/fit/calibration_errors", "is true, but the cantilever's uncertainty is not known"};
  if (!description.comb) return std::nullopt;
  const std::size_t tones = description.comb->tones.size();
  if (description.free_response && description.free_response->mean_nm.size() != tones)
    return Contradiction{"/free_response", fmt::format("has {} tones, must have {}, as the comb has",
                                                       description.free_response->mean_nm.size(), tones)};
  if (description.noise) {
    const std::size_t densities = description.noise->detector_nm_per_sqrt_hz.size();
    if (densities != 1 && densities != tones)
      return Contradiction{
          "/noise/detector_nm_per_sqrt_hz",
          fmt::format("has {} elements, must have {}, one a tone of the comb", densities, tones)};
  }
  if (description.scan) {
    const ScanLayout& scan = *description.scan;
    const std::uint64_t analysed = scan.windows * description.comb->window_samples;
    if (scan.pixel_samples < analysed || scan.pixel_samples - analysed < scan.settle_samples)
      return Contradiction{
          "/scan/pixel_samples",
          fmt::format("is {}, must be >= {}: settle_samples {} + windows {} * window_samples {}",
                      scan.pixel_samples, scan.settle_samples + analysed, scan.settle_samples, scan.windows,
                      description.comb->window_samples)};
  }
  return std::nullopt;
}

std::vector<std::string> find_doubts(const Description& description) {
  std::vector<std::string> doubts;
  const FitSettings fit = description.fit.value_or(FitSettings{});
  if (fit.background == Background::linear && description.free_response &&
      !description.free_response->lifted_nm)
    doubts.emplace_back(
        "fit.background is \"linear\" and the free response has no lifted_nm: without a lifted response "
        "every pixel is no_free_response");
  if (!description.cantilever || !description.comb) return doubts;
  const std::size_t told = 2 * description.comb->tones.size();
  for (const std::string& name : models_of(fit)) {
    const ModelInfo& model = find_model(name);
    const bool polynomial = visit_model(model, [](auto of) { return IsPolynomial<decltype(of)>; });
    if (model.parameters.size() <= told || polynomial) continue;  // its fit says itself what it cannot tell
    doubts.push_back(
        fmt::format("fit: model {} has {} parameters, and the comb tells {} numbers a pixel (two a tone): it "
                    "cannot determine them",
                    name, model.parameters.size(), told));
  }
  return doubts;
}

Description decode_description(const JsonView& object, std::string_view prefix, UnknownKeys unknown) {
  Description description;
  decode_one(description.channels, object, prefix, "channels", unknown, decode_channels);
  decode_one(description.cantilever, object, prefix, "cantilever", unknown, decode_cantilever);
  decode_one(description.excitation, object, prefix, "excitation", unknown, decode_excitation);
  decode_one(description.comb, object, prefix, "comb", unknown, decode_comb);
  decode_one(description.free_response, object, prefix, "free_response", unknown, decode_free_response);
  decode_one(description.scan, object, prefix, "scan", unknown, decode_scan);
  decode_one(description.noise, object, prefix, "noise", unknown, decode_noise);
  decode_one(description.fit, object, prefix, "fit", unknown, decode_fit);
  if (const auto fault = find_contradiction(description))
    JsonView(object.json(), object.file(),
             fmt::format("{}/{}{}", object.pointer(), prefix, fault->pointer.substr(1)))
        .fail(fault->message);
  return description;
}

void encode_into(Json& object, const Description& description, std::string_view prefix) {
  encode_one(object, description.channels, prefix, "channels");
  encode_one(object, description.cantilever, prefix, "cantilever");
  encode_one(object, description.excitation, prefix, "excitation");
  encode_one(object, description.comb, prefix, "comb");
  encode_one(object, description.free_response, prefix, "free_response");
  encode_one(object, description.scan, prefix, "scan");
  encode_one(object, description.noise, prefix, "noise");
  encode_one(object, description.fit, prefix, "fit");
}

}  // namespace combforce

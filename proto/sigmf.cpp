#include "proto/sigmf.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "proto/pixel_message.hpp"
#include "proto/sigmf_names.hpp"

namespace combforce {
namespace {

constexpr std::array<std::pair<std::string_view, SigmfDatatype>, 5> datatypes = {{
    {"ri16_le", {SigmfDatatype::Kind::i16, false}},
    {"ri16_be", {SigmfDatatype::Kind::i16, true}},
    {"rf32_le", {SigmfDatatype::Kind::f32, false}},
    {"ri8", {SigmfDatatype::Kind::i8, false}},
    {"ru8", {SigmfDatatype::Kind::u8, false}},
}};

void add_missing(Json& object, const Json& rest) {
  if (!rest.is_object()) return;
  for (const auto& [key, value] : rest.items()) {
    if (!object.contains(key)) {
      object[key] = value;
    } else if (object[key].is_object()) {
      add_missing(object[key], value);
    }
  }
}

Json encode_extensions(const Json& rest) {
  Json extensions = rest.is_object() ? rest.value("core:extensions", Json::array()) : Json::array();
  const bool listed = std::ranges::any_of(
      extensions, [](const Json& extension) { return extension.value("name", "") == "afm"; });
  if (!listed) extensions.push_back(Json{{"name", "afm"}, {"version", afm_version_text}, {"optional", true}});
  return extensions;
}

Json encode_global(const SigmfMeta& meta) {
  Json global{{"core:datatype", to_string(meta.datatype)},
              {"core:version", meta.rest.is_object() ? meta.rest.value("core:version", core_version_text)
                                                     : std::string(core_version_text)},
              {"core:sample_rate", meta.sample_rate_hz},
              {"core:num_channels", meta.num_channels}};
  if (meta.sha512) global["core:sha512"] = *meta.sha512;
  global["core:extensions"] = encode_extensions(meta.rest);
  encode_into(global, meta.description, "afm:");
  if (!meta.truth.is_null()) global["afm:truth"] = meta.truth;
  add_missing(global, meta.rest);
  return global;
}

Json encode_capture(const SigmfCapture& capture, std::uint32_t previous_epoch) {
  Json object{{"core:sample_start", capture.sample_start}, {"core:global_index", capture.global_index}};
  if (capture.datetime) object["core:datetime"] = *capture.datetime;
  if (capture.epoch != previous_epoch) {
    object["afm:epoch"] = capture.epoch;
    object["afm:epoch_reason"] = epoch_reason_names[static_cast<std::size_t>(capture.epoch_reason)];
    if (capture.epoch_first_sample != capture.global_index)
      object["afm:epoch_first_sample"] = capture.epoch_first_sample;
  }
  if (!capture.steps.empty()) object["afm:steps"] = capture.steps;
  if (!capture.scan_ends.empty()) object["afm:scan_ends"] = capture.scan_ends;
  encode_into(object, capture.changes, "afm:");
  if (capture.drops_free_response) object["afm:free_response"] = nullptr;
  add_missing(object, capture.rest);
  return object;
}

Json encode_line(const SigmfLine& line) {
  Json object{{"core:sample_start", line.sample_start},
              {"core:sample_count", line.sample_count},
              {"core:label", "line"},
              {"afm:line", line.mark.line},
              {"afm:frame", line.mark.frame},
              {"afm:direction", to_string(line.mark.direction)},
              {"afm:first_sample", line.mark.first_sample},
              {"afm:line_samples", line.mark.line_samples}};
  add_missing(object, line.rest);
  return object;
}

}  // namespace

SigmfDatatype parse_datatype(std::string_view name) {
  std::string readable;
  for (const auto& [known, datatype] : datatypes) {
    if (known == name) return datatype;
    readable += (readable.empty() ? "" : ", ") + std::string(known);
  }
  throw std::invalid_argument("is \"" + std::string(name) + "\", must be one of " + readable);
}

std::string to_string(SigmfDatatype datatype) {
  for (const auto& [name, known] : datatypes)
    if (known == datatype) return std::string(name);
  throw std::invalid_argument("no SigMF datatype is read or written that way");
}

Description in_force_from(const SigmfCapture& capture, Description before) {
  if (capture.drops_free_response) before.free_response.reset();
  return overlay(std::move(before), capture.changes);
}

std::uint64_t stream_index(const std::vector<SigmfCapture>& captures, std::uint64_t file_frame) {
  const auto next = std::ranges::upper_bound(captures, file_frame, {}, &SigmfCapture::sample_start);
  const SigmfCapture& capture = *std::prev(next);
  return capture.global_index + (file_frame - capture.sample_start);
}

Json encode_sigmf(const SigmfMeta& meta) {
  Json captures = Json::array();
  std::uint32_t epoch = 0;
  for (const auto& capture : meta.captures) {
    captures.push_back(encode_capture(capture, epoch));
    epoch = capture.epoch;
  }
  std::vector<Json> annotations(meta.other_annotations);
  for (const auto& line : meta.lines) annotations.push_back(encode_line(line));
  std::ranges::stable_sort(annotations, {}, [](const Json& annotation) {
    return annotation.at("core:sample_start").get<std::uint64_t>();
  });
  return Json{{"global", encode_global(meta)},
              {"captures", std::move(captures)},
              {"annotations", std::move(annotations)}};
}

SigmfPaths sigmf_paths(const std::string& recording) {
  std::string base = recording;
  for (const std::string_view suffix : {".sigmf-meta", ".sigmf-data"})
    if (base.ends_with(suffix)) {
      base.resize(base.size() - suffix.size());
      break;
    }
  return {base + ".sigmf-meta", base + ".sigmf-data"};
}

}  // namespace combforce

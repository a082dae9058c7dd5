#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>

#include "proto/sigmf.hpp"
#include "proto/sigmf_names.hpp"

namespace combforce {
namespace {

constexpr std::array<std::string_view, 7> description_keys = {
    "afm:channels", "afm:cantilever", "afm:comb", "afm:free_response", "afm:scan", "afm:noise", "afm:fit"};

SigmfVersion parse_version(const JsonView& view) {
  const std::string text = view.string();
  SigmfVersion version{};
  const char* const end = text.data() + text.size();
  const auto major = std::from_chars(text.data(), end, version.major);
  const bool dot = major.ec == std::errc{} && major.ptr != end && *major.ptr == '.';
  if (!dot || std::from_chars(major.ptr + 1, end, version.minor).ec != std::errc{})
    view.fail(fmt::format("is \"{}\", must be a version X.Y.Z", text));
  return version;
}

// The part of `raw` whose keys `known` does not have, objects within objects included.
Json unknown_part(const Json& raw, const Json& known) {
  Json rest = Json::object();
  for (const auto& [key, value] : raw.items()) {
    const auto match = known.find(key);
    if (match == known.end()) {
      rest[key] = value;
    } else if (value.is_object() && match->is_object()) {
      Json inner = unknown_part(value, *match);
      if (!inner.empty()) rest[key] = std::move(inner);
    }
  }
  return rest.empty() ? Json() : rest;
}

class Reader {
 public:
  Reader(const Json& root, const std::string& file) : root_(root, file) {}

  SigmfMeta read() {
    root_.only({"global", "captures", "annotations"});
    const auto global = root_.get("global");
    check_versions(global);
    read_global(global);
    read_captures(root_.get("captures"));
    read_annotations(root_.get("annotations"));
    keep_rest();
    return std::move(meta_);
  }

 private:
  void check_versions(const JsonView& global) {
    check_version(global.get("core:version"), "core", core_version);
    const auto extensions = global.find("core:extensions");
    if (!extensions) return;
    for (const auto& extension : extensions->elements()) {
      const std::string name = extension.get("name").string();
      const auto optional = extension.get("optional");
      if (name == "afm") {
        check_version(extension.get("version"), "afm", afm_version);
      } else if (!optional.boolean()) {
        optional.fail(fmt::format("the recording needs extension \"{}\", which is not supported", name));
      }
    }
  }

  void check_version(const JsonView& view, std::string_view name, SigmfVersion ours) {
    const SigmfVersion theirs = parse_version(view);
    if (theirs.major > ours.major)
      view.fail(
          fmt::format("is {}, must be {}.x: a newer major version of {}", view.string(), ours.major, name));
    if (theirs.major == ours.major && theirs.minor > ours.minor) {
      warn(view.pointer(), fmt::format("{} {} is newer than {}.{}: what it adds is not understood, but kept",
                                       name, view.string(), ours.major, ours.minor));
      if (name == "afm") unknown_ = UnknownKeys::allow;
    }
  }

  void warn(const std::string& pointer, const std::string& message) {
    meta_.warnings.emplace_back(InputError(root_.file(), pointer, message).what());
  }

  void warn_of_unknown(const JsonView& object, std::span<const std::string_view> known,
                       std::initializer_list<std::string_view> also) {
    if (unknown_ == UnknownKeys::allow) return;
    for (const auto& member : object.json().items()) {
      const std::string& key = member.key();
      const auto among = [&](const auto& keys) { return std::ranges::find(keys, key) != keys.end(); };
      if (key.starts_with("afm:") && !among(known) && !among(also))
        warn(object.get(key).pointer(), "unknown key, kept as it is");
    }
  }

  static void refuse_unless_zero(const JsonView& object, std::string_view key, std::string_view what) {
    const auto member = object.find(key);
    if (member && member->integer() != 0) member->fail(fmt::format("{} cannot be read", what));
  }

  void read_global(const JsonView& global) {
    const auto datatype = global.get("core:datatype");
    try {
      meta_.datatype = parse_datatype(datatype.string());
    } catch (const std::invalid_argument& error) {
      datatype.fail(error.what());
    }
    meta_.sample_rate_hz = global.get("core:sample_rate").number({.lower = 1.0, .upper = 1e12});
    if (const auto channels = global.find("core:num_channels"))
      meta_.num_channels = static_cast<std::uint32_t>(channels->integer(1, max_channels));
    if (const auto hash = global.find("core:sha512")) meta_.sha512 = read_sha512(*hash);
    if (const auto dataset = global.find("core:dataset"))
      dataset->fail("a non-conforming dataset cannot be read");
    if (const auto only = global.find("core:metadata_only"); only && only->boolean())
      only->fail("metadata without a dataset cannot be replayed");
    refuse_unless_zero(global, "core:trailing_bytes", "a non-conforming dataset");
    refuse_unless_zero(global, "core:offset", "a part of a split recording");
    meta_.description = decode_description(global, "afm:", unknown_);
    check_channels(global, meta_.description);
    if (const auto truth = global.find("afm:truth")) meta_.truth = read_truth(*truth);
    warn_of_unknown(global, description_keys, {"afm:truth"});
  }

  static std::string read_sha512(const JsonView& view) {
    constexpr std::size_t digits = 128;
    std::string hash = view.string();
    const auto is_digit = [](unsigned char c) { return std::isxdigit(c) != 0; };
    if (hash.size() != digits || !std::ranges::all_of(hash, is_digit))
      view.fail("must have 128 hexadecimal digits");
    for (char& c : hash) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return hash;
  }

  static Json read_truth(const JsonView& view) {
    if (const auto file = view.find("file")) {
      (void)file->string();
    } else {
      (void)view.get("model").string();
      (void)view.get("parameters").find("");  // an object
    }
    return view.json();
  }

  void check_channels(const JsonView& object, const Description& description) const {
    if (description.channels && description.channels->size() != meta_.num_channels)
      object.get("afm:channels")
          .fail(fmt::format("has {} elements, must have {}, as core:num_channels says",
                            description.channels->size(), meta_.num_channels));
  }

  void read_captures(const JsonView& list) {
    Description in_force = meta_.description;
    for (const auto& view : list.elements()) {
      SigmfCapture capture = read_capture(view);
      check_order(view, capture);
      in_force = in_force_from(capture, std::move(in_force));
      if (const auto fault = find_contradiction(in_force))
        view.fail(
            fmt::format("with what is in force here, afm:{} {}", fault->pointer.substr(1), fault->message));
      meta_.captures.push_back(std::move(capture));
    }
    if (meta_.captures.empty()) meta_.captures.emplace_back();  // as the standard has it
  }

  SigmfCapture read_capture(const JsonView& view) {
    SigmfCapture capture;
    capture.sample_start = view.get("core:sample_start").integer();
    const auto index = view.find("core:global_index");
    capture.global_index = index ? index->integer() : capture.sample_start;
    if (const auto datetime = view.find("core:datetime")) capture.datetime = datetime->string();
    refuse_unless_zero(view, "core:header_bytes", "a non-conforming dataset");
    if (!meta_.captures.empty()) {
      capture.epoch = meta_.captures.back().epoch;
      capture.epoch_reason = meta_.captures.back().epoch_reason;
      capture.epoch_first_sample = meta_.captures.back().epoch_first_sample;
    }
    if (const auto epoch = view.find("afm:epoch"); epoch && epoch->integer() != capture.epoch) {
      capture.epoch = static_cast<std::uint32_t>(epoch->integer(capture.epoch, max_u32));
      capture.epoch_reason = EpochReason::unknown_loss;
      capture.epoch_first_sample = capture.global_index;
    }
    if (const auto reason = view.find("afm:epoch_reason"))
      capture.epoch_reason = static_cast<EpochReason>(reason->one_of(epoch_reason_names));
    if (const auto first = view.find("afm:epoch_first_sample"))
      capture.epoch_first_sample = first->integer(0, capture.global_index);
    capture.steps = read_ascending(view, "afm:steps");
    capture.scan_ends = read_ascending(view, "afm:scan_ends");
    Json object = view.json();
    if (const auto free = view.find("afm:free_response"); free && free->json().is_null()) {
      capture.drops_free_response = true;
      object.erase("afm:free_response");
    }
    capture.changes = decode_description(JsonView(object, view.file(), view.pointer()), "afm:", unknown_);
    check_channels(view, capture.changes);
    warn_of_unknown(
        view, description_keys,
        {"afm:epoch", "afm:epoch_reason", "afm:epoch_first_sample", "afm:steps", "afm:scan_ends"});
    return capture;
  }

  static std::vector<std::uint64_t> read_ascending(const JsonView& object, std::string_view key) {
    std::vector<std::uint64_t> samples;
    if (const auto list = object.find(key))
      for (const auto& sample : list->elements())
        samples.push_back(sample.integer(samples.empty() ? 0 : samples.back()));
    return samples;
  }

  void check_order(const JsonView& view, const SigmfCapture& capture) const {
    const auto start = view.get("core:sample_start");
    if (meta_.captures.empty()) {
      if (capture.sample_start != 0)
        start.fail(fmt::format("is {}, must be 0 in the first capture", capture.sample_start));
      return;
    }
    const SigmfCapture& previous = meta_.captures.back();
    if (capture.sample_start < previous.sample_start)
      start.fail(fmt::format("is {}, must be >= {}: captures are out of order", capture.sample_start,
                             previous.sample_start));
    const std::uint64_t earliest = previous.global_index + (capture.sample_start - previous.sample_start);
    if (capture.global_index < earliest) {
      const auto index = view.find("core:global_index");
      index.value_or(view).fail(
          fmt::format("core:global_index is {}, must be >= {}: it runs backwards into the previous capture",
                      capture.global_index, earliest));
    }
  }

  void read_annotations(const JsonView& list) {
    std::uint64_t previous = 0;
    for (const auto& view : list.elements()) {
      const auto start = view.get("core:sample_start");
      if (start.integer() < previous)
        start.fail(
            fmt::format("is {}, must be >= {}: annotations are out of order", start.integer(), previous));
      previous = start.integer();
      if (marks_line(view)) {
        meta_.lines.push_back(read_line(view));
        raw_lines_.push_back(&view.json());
      } else {
        meta_.other_annotations.push_back(view.json());
      }
    }
  }

  // Labelled "line" with at least one key of ours: others may use the same label.
  static bool marks_line(const JsonView& view) {
    const auto label = view.find("core:label");
    if (!label || label->string() != "line") return false;
    const auto& members = view.json().get_ref<const Json::object_t&>();
    return std::ranges::any_of(members, [](const auto& member) { return member.first.starts_with("afm:"); });
  }

  SigmfLine read_line(const JsonView& view) {
    SigmfLine line;
    line.mark.line = static_cast<std::uint32_t>(view.get("afm:line").integer(0, max_u32));
    if (const auto frame = view.find("afm:frame"))
      line.mark.frame = static_cast<std::uint32_t>(frame->integer(0, max_u32));
    if (const auto direction = view.find("afm:direction"))
      line.mark.direction = static_cast<Direction>(direction->one_of(direction_names));
    line.sample_start = view.get("core:sample_start").integer();
    const auto first = view.find("afm:first_sample");
    line.mark.first_sample = first ? first->integer() : stream_index(meta_.captures, line.sample_start);
    const auto length = view.find("afm:line_samples");
    if (length) line.mark.line_samples = length->integer(1);
    line.sample_count = read_count(view, line);
    if (!length) {
      if (line.sample_count == 0) view.fail("afm:line_samples is missing and core:sample_count is 0");
      line.mark.line_samples = last_sample(line) + 1 - std::min(line.mark.first_sample, last_sample(line));
    }
    check_range(view, line);
    warn_of_unknown(view, {},
                    {"afm:line", "afm:frame", "afm:direction", "afm:first_sample", "afm:line_samples"});
    return line;
  }

  // core:sample_count, or as far as the capture and the line go.
  std::uint64_t read_count(const JsonView& view, const SigmfLine& line) const {
    if (const auto count = view.find("core:sample_count")) return count->integer();
    const auto next = std::ranges::find_if(meta_.captures, [&](const SigmfCapture& capture) {
      return capture.sample_start > line.sample_start;
    });
    if (line.mark.line_samples == 0 && next == meta_.captures.end())
      view.fail("core:sample_count and afm:line_samples are missing: the line has no end");
    const std::uint64_t to_line_end = line.mark.line_samples == 0 ? UINT64_MAX : line.mark.line_samples;
    return next == meta_.captures.end() ? to_line_end
                                        : std::min(to_line_end, next->sample_start - line.sample_start);
  }

  std::uint64_t last_sample(const SigmfLine& line) const {
    return stream_index(meta_.captures, line.sample_start + line.sample_count - 1);
  }

  void check_range(const JsonView& view, const SigmfLine& line) const {
    if (line.sample_count == 0) return;
    const std::uint64_t first = stream_index(meta_.captures, line.sample_start);
    const std::uint64_t end = line.mark.first_sample + line.mark.line_samples;
    if (first < line.mark.first_sample || last_sample(line) >= end)
      view.fail(fmt::format("the frames are stream samples {} to {}, must lie in the line's {} to {}", first,
                            last_sample(line), line.mark.first_sample, end - 1));
  }

  void keep_rest() {
    const Json known = encode_sigmf(meta_);
    const Json& global = root_.json().at("global");
    const Json& captures = root_.json().at("captures");
    Json rest = unknown_part(global, known.at("global"));
    for (const std::string key : {"core:version", "core:extensions"})
      if (global.contains(key)) rest[key] = global.at(key);
    for (std::size_t i = 0; i < captures.size(); ++i)
      meta_.captures[i].rest = unknown_part(captures[i], known.at("captures")[i]);
    SigmfMeta lines_only;
    lines_only.lines = meta_.lines;
    const Json known_lines = encode_sigmf(lines_only).at("annotations");
    for (std::size_t i = 0; i < raw_lines_.size(); ++i)
      meta_.lines[i].rest = unknown_part(*raw_lines_[i], known_lines[i]);
    meta_.rest = std::move(rest);
  }

  static constexpr std::uint64_t max_u32 = std::numeric_limits<std::uint32_t>::max();
  static constexpr std::uint64_t max_channels = std::numeric_limits<std::uint16_t>::max();
  JsonView root_;
  SigmfMeta meta_;
  UnknownKeys unknown_ = UnknownKeys::refuse;
  std::vector<const Json*> raw_lines_;
};

}  // namespace

SigmfMeta parse_sigmf_meta(const Json& root, const std::string& file) {
  return Reader(root, file).read();
}

SigmfMeta read_sigmf_meta(const std::string& path) {
  return parse_sigmf_meta(parse_json_file(path), path);
}

}  // namespace combforce

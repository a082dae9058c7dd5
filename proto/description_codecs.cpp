#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "proto/description.hpp"
#include "proto/fields.hpp"

namespace combforce {
namespace {

constexpr std::array<std::string_view, 4> role_names = {"deflection", "z", "reference", "marker"};
constexpr std::array<std::string_view, 2> unit_names = {"V", "nm"};
constexpr std::array<std::string_view, 3> scheme_names = {"equal_energy", "equal_amplitude", "amplitudes"};

Channel decode_channel(const JsonView& view, UnknownKeys unknown) {
  check_keys(view, unknown, {"name", "role", "unit", "scale", "offset", "nm_per_v", "clip_codes"});
  Channel channel;
  channel.name = view.get("name").string();
  if (channel.name.empty()) view.get("name").fail("is empty, must name the channel");
  channel.role = static_cast<ChannelRole>(view.get("role").one_of(role_names));
  if (const auto unit = view.find("unit")) channel.unit = name_of(unit_names, unit->one_of(unit_names));
  if (const auto scale = view.find("scale")) channel.scale = non_zero(*scale);
  channel.offset = number_or(view, "offset", 0.0);
  if (const auto nm_per_v = view.find("nm_per_v")) {
    if (channel.role != ChannelRole::deflection) nm_per_v->fail("belongs to the deflection alone");
    channel.nm_per_v = non_zero(*nm_per_v);
  }
  if (const auto clip = view.find("clip_codes")) {
    const auto [lo, hi] = interval(*clip);
    channel.clip_codes = Channel::ClipCodes{lo, hi};
  }
  return channel;
}

std::vector<double> decode_covariance(const JsonView& view, std::size_t order) {
  const auto rows = view.elements();
  if (rows.size() != order)
    view.fail(fmt::format("has {} rows, must have {}, two a tone", rows.size(), order));
  std::vector<double> matrix;
  for (const auto& row : rows) {
    if (row.size() != order) row.fail(fmt::format("has {} elements, must have {}", row.size(), order));
    const auto values = numbers(row, any_number);
    matrix.insert(matrix.end(), values.begin(), values.end());
  }
  return matrix;
}

}  // namespace

Channels decode_channels(const JsonView& view, UnknownKeys unknown) {
  Channels channels;
  std::set<std::string> names;
  for (const auto& element : not_empty(view)) {
    channels.push_back(decode_channel(element, unknown));
    if (!names.insert(channels.back().name).second)
      element.get("name").fail(fmt::format("is \"{}\", which an earlier channel has", channels.back().name));
  }
  if (channels.front().role != ChannelRole::deflection)
    view.elements().front().get("role").fail("must be \"deflection\": channel 0 is the one that is analysed");
  return channels;
}

Comb decode_comb(const JsonView& view, UnknownKeys unknown) {
  check_keys(view, unknown, {"window_samples", "tones"});
  Comb comb;
  comb.window_samples = view.get("window_samples").integer(3, std::numeric_limits<std::uint32_t>::max());
  std::set<std::uint64_t> bins;
  for (const auto& element : not_empty(view.get("tones"))) {
    check_keys(element, unknown, {"bin", "driven"});
    const auto bin = element.get("bin");
    Tone tone;
    tone.bin = bin.integer();
    if (tone.bin == 0 || 2 * tone.bin >= comb.window_samples)
      bin.fail(fmt::format("is {}, must be > 0 and < window_samples/2 = {}", tone.bin,
                           static_cast<double>(comb.window_samples) / 2.0));
    if (!bins.insert(tone.bin).second) bin.fail(fmt::format("is {}, which an earlier tone has", tone.bin));
    if (const auto driven = element.find("driven")) tone.driven = driven->boolean();
    comb.tones.push_back(tone);
  }
  return comb;
}

FreeResponse decode_free_response(const JsonView& view, UnknownKeys unknown) {
  FreeResponse free_response;
  if (view.json().is_array()) {
    free_response.mean_nm = phasors(view);
    return free_response;
  }
  check_keys(view, unknown,
             {"first_sample", "windows", "mean_nm", "covariance", "coherent", "lifted_nm", "lifted_windows"});
  free_response.first_sample = integer_or(view, "first_sample", 0);
  free_response.windows = integer_or(view, "windows", 0);
  free_response.mean_nm = phasors(view.get("mean_nm"));
  if (const auto covariance = view.find("covariance"))
    free_response.covariance = decode_covariance(*covariance, 2 * free_response.mean_nm.size());
  if (const auto coherent = view.find("coherent")) free_response.coherent = coherent->boolean();
  if (const auto lifted = view.find("lifted_nm")) {
    free_response.lifted_nm = phasors(*lifted);
    free_response.lifted_windows = integer_or(view, "lifted_windows", 0);
    if (lifted->size() != free_response.mean_nm.size())
      lifted->fail(fmt::format("has {} elements, must have {}, as mean_nm has", lifted->size(),
                               free_response.mean_nm.size()));
  }
  return free_response;
}

ScanLayout decode_scan(const JsonView& view, UnknownKeys unknown) {
  check_keys(view, unknown,
             {"lines", "columns", "pixel_samples", "settle_samples", "windows", "bidirectional", "size_nm"});
  ScanLayout scan;
  scan.lines = count(view.get("lines"), most_pixels_a_side);
  scan.columns = count(view.get("columns"), most_pixels_a_side);
  scan.pixel_samples = view.get("pixel_samples").integer(1);
  scan.settle_samples = integer_or(view, "settle_samples", 0);
  if (const auto windows = view.find("windows")) scan.windows = count(*windows);
  if (const auto bidirectional = view.find("bidirectional")) scan.bidirectional = bidirectional->boolean();
  if (const auto size = view.find("size_nm")) {
    const auto sides = numbers(*size, non_negative);
    if (sides.size() != 2) size->fail(fmt::format("has {} elements, must be [x, y]", sides.size()));
    scan.size_nm = {sides[0], sides[1]};
  }
  return scan;
}

Drive decode_drive(const JsonView& view, UnknownKeys unknown) {
  check_keys(view, unknown, {"scheme", "total_amplitude_nm", "amplitudes_nm", "phases_rad"});
  Drive drive;
  if (const auto scheme = view.find("scheme"))
    drive.scheme = static_cast<DriveScheme>(scheme->one_of(scheme_names));
  const bool listed = drive.scheme == DriveScheme::amplitudes;
  if (const auto foreign = view.find(listed ? "total_amplitude_nm" : "amplitudes_nm"))
    foreign->fail(fmt::format("does not belong to scheme \"{}\"", name_of(scheme_names, drive.scheme)));
  drive.total_amplitude_nm = number_or(view, "total_amplitude_nm", drive.total_amplitude_nm, positive);
  if (listed) drive.amplitudes_nm = numbers(view.get("amplitudes_nm"), non_negative);
  if (const auto phases = view.find("phases_rad")) drive.phases_rad = numbers(*phases, any_number);
  return drive;
}

Json encode(const Channels& channels) {
  Json list = Json::array();
  for (const auto& channel : channels) {
    Json item{{"name", channel.name},
              {"role", name_of(role_names, channel.role)},
              {"unit", channel.unit},
              {"scale", channel.scale},
              {"offset", channel.offset}};
    if (channel.nm_per_v) item["nm_per_v"] = *channel.nm_per_v;
    if (channel.clip_codes) item["clip_codes"] = {channel.clip_codes->lo, channel.clip_codes->hi};
    list.push_back(std::move(item));
  }
  return list;
}

Json encode(const Comb& comb) {
  Json tones = Json::array();
  for (const auto& tone : comb.tones) tones.push_back(Json{{"bin", tone.bin}, {"driven", tone.driven}});
  return Json{{"window_samples", comb.window_samples}, {"tones", std::move(tones)}};
}

Json encode(const FreeResponse& free_response) {
  Json object{{"first_sample", free_response.first_sample},
              {"windows", free_response.windows},
              {"mean_nm", encode_phasors(free_response.mean_nm)}};
  if (free_response.covariance) {
    const std::size_t order = 2 * free_response.mean_nm.size();
    Json rows = Json::array();
    for (auto row = free_response.covariance->begin(); row != free_response.covariance->end();
         row += static_cast<std::ptrdiff_t>(order))
      rows.push_back(std::vector<double>(row, row + static_cast<std::ptrdiff_t>(order)));
    object["covariance"] = std::move(rows);
  }
  if (!free_response.coherent) object["coherent"] = false;
  if (free_response.lifted_nm) {
    object["lifted_nm"] = encode_phasors(*free_response.lifted_nm);
    object["lifted_windows"] = free_response.lifted_windows;
  }
  return object;
}

Json encode(const ScanLayout& scan) {
  return Json{{"lines", scan.lines},
              {"columns", scan.columns},
              {"pixel_samples", scan.pixel_samples},
              {"settle_samples", scan.settle_samples},
              {"windows", scan.windows},
              {"bidirectional", scan.bidirectional},
              {"size_nm", scan.size_nm}};
}

Json encode(const Drive& drive) {
  Json object{{"scheme", name_of(scheme_names, drive.scheme)}};
  if (drive.scheme == DriveScheme::amplitudes) {
    object["amplitudes_nm"] = drive.amplitudes_nm;
  } else {
    object["total_amplitude_nm"] = drive.total_amplitude_nm;
  }
  object["phases_rad"] = drive.phases_rad;
  return object;
}

}  // namespace combforce

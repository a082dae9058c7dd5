#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "proto/description.hpp"

namespace combforce {
namespace {

using Names = std::span<const std::string_view>;

constexpr std::array<std::string_view, 4> role_names = {"deflection", "z", "reference", "marker"};
constexpr std::array<std::string_view, 2> unit_names = {"V", "nm"};
constexpr std::array<std::string_view, 2> weighting_names = {"none", "noise"};
constexpr std::array<std::string_view, 3> scheme_names = {"equal_energy", "equal_amplitude", "amplitudes"};

template <typename Enum>
std::string_view name_of(Names names, Enum value) {
  return names[static_cast<std::size_t>(value)];
}

void check_keys(const JsonView& view, UnknownKeys unknown, std::initializer_list<std::string_view> keys) {
  if (unknown == UnknownKeys::refuse) view.only(keys);
}

double number_or(const JsonView& view, std::string_view key, double otherwise, Range range = any_number) {
  const auto member = view.find(key);
  return member ? member->number(range) : otherwise;
}

std::uint64_t integer_or(const JsonView& view, std::string_view key, std::uint64_t otherwise) {
  const auto member = view.find(key);
  return member ? member->integer() : otherwise;
}

std::uint32_t count(const JsonView& view, std::uint32_t most = std::numeric_limits<std::uint32_t>::max()) {
  return static_cast<std::uint32_t>(view.integer(1, most));
}

double non_zero(const JsonView& view) {
  const double value = view.number();
  if (value == 0.0) view.fail("is 0, must not be 0");
  return value;
}

std::vector<JsonView> not_empty(const JsonView& view) {
  auto elements = view.elements();
  if (elements.empty()) view.fail("is empty, must have at least one element");
  return elements;
}

std::vector<double> numbers(const JsonView& view, Range range) {
  std::vector<double> values;
  for (const auto& element : view.elements()) values.push_back(element.number(range));
  return values;
}

// [lo, hi], lo < hi.
std::array<double, 2> interval(const JsonView& view) {
  const auto ends = numbers(view, any_number);
  if (ends.size() != 2) view.fail(fmt::format("has {} elements, must be [lo, hi]", ends.size()));
  if (!(ends[0] < ends[1]))
    view.fail(fmt::format("is [{}, {}], must be [lo, hi] with lo < hi", ends[0], ends[1]));
  return {ends[0], ends[1]};
}

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

std::vector<std::complex<double>> decode_phasors(const JsonView& view) {
  std::vector<std::complex<double>> phasors;
  for (const auto& phasor : not_empty(view)) phasors.push_back(phasor.complex());
  return phasors;
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

TipGeometry decode_tip(const JsonView& view, UnknownKeys unknown) {
  check_keys(
      view, unknown,
      {"radius_nm", "half_angle_deg", "sample_poisson_ratio", "tip_young_modulus_gpa", "tip_poisson_ratio"});
  TipGeometry tip;
  const auto read = [&](std::string_view key, std::optional<double>& value) {
    if (const auto member = view.find(key)) value = member->number();
  };
  read("radius_nm", tip.radius_nm);
  read("half_angle_deg", tip.half_angle_deg);
  read("sample_poisson_ratio", tip.sample_poisson_ratio);
  read("tip_young_modulus_gpa", tip.tip_young_modulus_gpa);
  tip.tip_poisson_ratio = number_or(view, "tip_poisson_ratio", tip.tip_poisson_ratio);
  try {
    validate(tip);
  } catch (const std::invalid_argument& error) {
    view.fail(error.what());
  }
  return tip;
}

Json encode_tip(const TipGeometry& tip) {
  Json object{{"tip_poisson_ratio", tip.tip_poisson_ratio}};
  if (tip.radius_nm) object["radius_nm"] = *tip.radius_nm;
  if (tip.half_angle_deg) object["half_angle_deg"] = *tip.half_angle_deg;
  if (tip.sample_poisson_ratio) object["sample_poisson_ratio"] = *tip.sample_poisson_ratio;
  if (tip.tip_young_modulus_gpa) object["tip_young_modulus_gpa"] = *tip.tip_young_modulus_gpa;
  return object;
}

ParameterBounds decode_bounds(const JsonView& bounds, const std::string& parameter, const ModelInfo& model) {
  const auto view = bounds.get(parameter);
  const auto known = [&](const ParameterInfo& info) { return info.name == parameter; };
  if (std::ranges::none_of(model.parameters, known)) {
    std::string names;
    for (const auto& info : model.parameters)
      names += fmt::format("{}{}", names.empty() ? "" : ", ", info.name);
    view.fail(fmt::format("is no parameter of model \"{}\"; it has {}", model.name, names));
  }
  const auto [lower, upper] = interval(view);
  return {parameter, lower, upper};
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

Cantilever decode_cantilever(const JsonView& view, UnknownKeys unknown) {
  check_keys(view, unknown, {"modes"});
  Cantilever cantilever;
  for (const auto& element : not_empty(view.get("modes"))) {
    check_keys(element, unknown,
               {"frequency_hz", "quality_factor", "stiffness_n_per_m", "sensitivity_nm_per_v"});
    Mode mode;
    mode.frequency_hz = element.get("frequency_hz").number(positive);
    mode.quality_factor = element.get("quality_factor").number(positive);
    mode.stiffness_n_per_m = element.get("stiffness_n_per_m").number(positive);
    if (const auto alpha = element.find("sensitivity_nm_per_v")) mode.sensitivity_nm_per_v = non_zero(*alpha);
    cantilever.modes.push_back(mode);
  }
  return cantilever;
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
    free_response.mean_nm = decode_phasors(view);
    return free_response;
  }
  check_keys(view, unknown, {"first_sample", "windows", "mean_nm", "covariance", "coherent"});
  free_response.first_sample = integer_or(view, "first_sample", 0);
  free_response.windows = integer_or(view, "windows", 0);
  free_response.mean_nm = decode_phasors(view.get("mean_nm"));
  if (const auto covariance = view.find("covariance"))
    free_response.covariance = decode_covariance(*covariance, 2 * free_response.mean_nm.size());
  if (const auto coherent = view.find("coherent")) free_response.coherent = coherent->boolean();
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

Noise decode_noise(const JsonView& view, UnknownKeys unknown) {
  check_keys(view, unknown, {"temperature_k", "detector_nm_per_sqrt_hz"});
  Noise noise;
  noise.temperature_k = view.get("temperature_k").number(non_negative);
  const auto detector = view.get("detector_nm_per_sqrt_hz");
  if (detector.json().is_array()) {
    not_empty(detector);
    noise.detector_nm_per_sqrt_hz = numbers(detector, non_negative);
  } else {
    noise.detector_nm_per_sqrt_hz = {detector.number(non_negative)};
  }
  return noise;
}

FitSettings decode_fit(const JsonView& view, UnknownKeys unknown) {
  check_keys(view, unknown, {"model", "refine", "weighting", "profile_intervals", "bounds", "tip"});
  constexpr std::uint64_t most_refinements = 100;
  FitSettings fit;
  if (const auto model = view.find("model")) fit.model = model->string();
  const ModelInfo* model = nullptr;
  try {
    model = &find_model(fit.model);
  } catch (const std::invalid_argument& error) {
    view.get("model").fail(error.what());
  }
  if (const auto refine = view.find("refine"))
    fit.refine = static_cast<unsigned>(refine->integer(0, most_refinements));
  if (const auto weighting = view.find("weighting"))
    fit.weighting = static_cast<Weighting>(weighting->one_of(weighting_names));
  if (const auto intervals = view.find("profile_intervals")) fit.profile_intervals = intervals->boolean();
  if (const auto bounds = view.find("bounds")) {
    bounds->find("");  // fails unless it is an object
    for (const auto& member : bounds->json().items())
      fit.bounds.push_back(decode_bounds(*bounds, member.key(), *model));
  }
  if (const auto tip = view.find("tip")) fit.tip = decode_tip(*tip, unknown);
  return fit;
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

Json encode(const Cantilever& cantilever) {
  Json modes = Json::array();
  for (const auto& mode : cantilever.modes)
    modes.push_back(Json{{"frequency_hz", mode.frequency_hz},
                         {"quality_factor", mode.quality_factor},
                         {"stiffness_n_per_m", mode.stiffness_n_per_m},
                         {"sensitivity_nm_per_v", mode.sensitivity_nm_per_v}});
  return Json{{"modes", std::move(modes)}};
}

Json encode(const Comb& comb) {
  Json tones = Json::array();
  for (const auto& tone : comb.tones) tones.push_back(Json{{"bin", tone.bin}, {"driven", tone.driven}});
  return Json{{"window_samples", comb.window_samples}, {"tones", std::move(tones)}};
}

Json encode(const FreeResponse& free_response) {
  Json mean = Json::array();
  for (const auto& phasor : free_response.mean_nm)
    mean.push_back(Json::array({phasor.real(), phasor.imag()}));
  Json object{{"first_sample", free_response.first_sample},
              {"windows", free_response.windows},
              {"mean_nm", std::move(mean)}};
  if (free_response.covariance) {
    const std::size_t order = 2 * free_response.mean_nm.size();
    Json rows = Json::array();
    for (auto row = free_response.covariance->begin(); row != free_response.covariance->end();
         row += static_cast<std::ptrdiff_t>(order))
      rows.push_back(std::vector<double>(row, row + static_cast<std::ptrdiff_t>(order)));
    object["covariance"] = std::move(rows);
  }
  if (!free_response.coherent) object["coherent"] = false;
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

Json encode(const Noise& noise) {
  const auto& detector = noise.detector_nm_per_sqrt_hz;
  return Json{{"temperature_k", noise.temperature_k},
              {"detector_nm_per_sqrt_hz", detector.size() == 1 ? Json(detector.front()) : Json(detector)}};
}

Json encode(const FitSettings& fit) {
  Json bounds = Json::object();
  for (const auto& bound : fit.bounds) bounds[bound.parameter] = {bound.lower, bound.upper};
  Json object{{"model", fit.model},
              {"refine", fit.refine},
              {"weighting", name_of(weighting_names, fit.weighting)},
              {"profile_intervals", fit.profile_intervals},
              {"bounds", std::move(bounds)}};
  if (fit.tip) object["tip"] = encode_tip(*fit.tip);
  return object;
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

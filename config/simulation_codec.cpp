#include "config/simulation_codec.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <span>

#include "config/field_message.hpp"
#include "drivers/digitizer.hpp"
#include "drivers/simulated/scene.hpp"
#include "fit/force_model.hpp"

namespace combforce {
namespace {

using Names = std::span<const std::string_view>;

constexpr std::array<std::string_view, 3> scene_names = {"flat", "blend", "maps"};
constexpr std::array<std::string_view, 5> fault_names = {"lost_block", "unknown_loss", "clipped", "stall",
                                                         "detuned"};
constexpr std::array<std::string_view, 2> accuracy_names = {"live", "accurate"};

template <typename Enum>
std::string_view name_of(Names names, Enum value) {
  return names[static_cast<std::size_t>(value)];
}

void read(const JsonView& view, std::string_view key, double& value, Range range = any_number) {
  if (const auto member = view.find(key)) value = member->number(range);
}

void read(const JsonView& view, std::string_view key, bool& value) {
  if (const auto member = view.find(key)) value = member->boolean();
}

void read(const JsonView& view, std::string_view key, std::uint32_t& value, std::uint32_t upper) {
  if (const auto member = view.find(key)) value = static_cast<std::uint32_t>(member->integer(1, upper));
}

void read_seed(const JsonView& view, std::uint64_t& seed) {
  if (const auto member = view.find("seed")) seed = member->integer();
}

// Parameters a material has: all but the surface position.
std::span<const ParameterInfo> material_parameters(const ModelInfo& model) {
  return model.parameters.subspan(1);
}

void only_parameters(const JsonView& view, const ModelInfo& model) {
  for (const auto& member : view.json().items()) {
    const auto parameters = material_parameters(model);
    const auto known = [&](const ParameterInfo& info) { return info.name == member.key(); };
    if (std::ranges::none_of(parameters, known))
      view.get(member.key()).fail(fmt::format("is no material parameter of model \"{}\"", model.name));
  }
}

Material decode_material(const JsonView& view, const ModelInfo& model) {
  Material material;
  for (const auto& info : material_parameters(model))
    material.parameters.push_back(view.get(info.name).number({.lower = info.lower, .upper = info.upper}));
  only_parameters(view, model);
  return material;
}

std::vector<Material> decode_materials(const JsonView& view, const ModelInfo& model, std::size_t count) {
  if (view.size() != count) view.fail(fmt::format("has {} elements, must have {}", view.size(), count));
  std::vector<Material> materials;
  for (const auto& element : view.elements()) materials.push_back(decode_material(element, model));
  return materials;
}

SceneSettings decode_scene(const JsonView& view, const ModelInfo& model, const std::filesystem::path& base) {
  SceneSettings scene;
  scene.kind = static_cast<SceneSettings::Kind>(view.get("kind").one_of(scene_names));
  switch (scene.kind) {
    case SceneSettings::Kind::flat:
      view.only({"kind", "materials"});
      scene.materials = decode_materials(view.get("materials"), model, 1);
      break;
    case SceneSettings::Kind::blend:
      view.only({"kind", "materials", "step_nm", "grain_nm", "domain_nm", "seed"});
      scene.materials = decode_materials(view.get("materials"), model, 2);
      read(view, "step_nm", scene.step_nm);
      read(view, "grain_nm", scene.grain_nm, non_negative);
      read(view, "domain_nm", scene.domain_nm, positive);
      read_seed(view, scene.seed);
      break;
    case SceneSettings::Kind::maps: {
      view.only({"kind", "height_map", "parameter_maps"});
      scene.height_map = resolve_path(view.get("height_map"), base);
      const auto maps = view.get("parameter_maps");
      for (const auto& info : material_parameters(model))
        scene.parameter_maps.push_back(resolve_path(maps.get(info.name), base));
      only_parameters(maps, model);
      break;
    }
  }
  return scene;
}

FeedbackSettings decode_feedback(const JsonView& view) {
  view.only({"enabled", "set_point", "gain", "start_z_nm"});
  FeedbackSettings feedback;
  read(view, "enabled", feedback.enabled);
  read(view, "set_point", feedback.set_point,
       {.lower = 0.0, .upper = 1.0, .lower_open = true, .upper_open = true});
  read(view, "gain", feedback.gain, {.lower = 0.0, .upper = 2.0});
  read(view, "start_z_nm", feedback.start_z_nm);
  return feedback;
}

std::vector<FaultSettings> decode_faults(const JsonView& view) {
  std::vector<FaultSettings> faults;
  for (const auto& element : view.elements()) {
    FaultSettings fault;
    fault.kind = static_cast<FaultSettings::Kind>(element.get("kind").one_of(fault_names));
    fault.sample = element.get("sample").integer(faults.empty() ? 0 : faults.back().sample);
    if (fault.kind == FaultSettings::Kind::stall) {
      element.only({"kind", "sample", "duration_s"});
      fault.duration_s = element.get("duration_s").number(positive);
    } else if (fault.kind == FaultSettings::Kind::detuned) {
      element.only({"kind", "sample", "detuning_ppm"});
      fault.detuning_ppm = element.get("detuning_ppm").number();
    } else {
      element.only({"kind", "sample", "frames"});
      fault.frames = element.get("frames").integer(1);
    }
    faults.push_back(fault);
  }
  return faults;
}

// The object `key` of the section, else the one at the top, else an error.
template <typename T, typename Decode>
T own_or_top(const JsonView& view, std::string_view key, const std::optional<T>& top, Decode decode) {
  const auto own = view.find(key);
  if (!own && top) return *top;
  return decode(view.get(key), UnknownKeys::refuse);
}

void read_instrument(const JsonView& view, const Description& top, SimulationSettings& simulation) {
  simulation.sample_rate_hz = view.get("sample_rate_hz").number({.lower = 1.0, .upper = 1e12});
  simulation.cantilever = own_or_top(view, "cantilever", top.cantilever, decode_cantilever);
  simulation.comb = own_or_top(view, "comb", top.comb, decode_comb);
  simulation.layout = own_or_top(view, "scan", top.scan, decode_scan);
  if (const auto drive = view.find("drive")) simulation.drive = decode_drive(*drive);
  if (const auto feedback = view.find("feedback")) simulation.feedback = decode_feedback(*feedback);
  if (top.noise) {
    simulation.temperature_k = top.noise->temperature_k;
    if (top.noise->detector_nm_per_sqrt_hz.size() == 1)
      simulation.detector_nm_per_sqrt_hz = top.noise->detector_nm_per_sqrt_hz.front();
  }
  read(view, "temperature_k", simulation.temperature_k, non_negative);
  read(view, "detector_nm_per_sqrt_hz", simulation.detector_nm_per_sqrt_hz, non_negative);
  read(view, "volts_per_code", simulation.volts_per_code, non_negative);
  read(view, "z_nm_per_code", simulation.z_nm_per_code, non_negative);
}

void read_surface(const JsonView& view, const Description& top, const std::filesystem::path& base,
                  SimulationSettings& simulation) {
  const auto own = view.find("model");
  if (!own && !top.fit) view.get("model");  // is missing
  simulation.model = own ? own->string() : top.fit->model;
  try {
    const ModelInfo& model = find_model(simulation.model);
    if (const std::string_view why = why_partial_fit_only(model); !why.empty())
      own.value_or(view).fail(fmt::format("{} \"{}\", which is not simulated: {}",
                                          own ? "is" : "needs a \"model\", as that of the fit is", model.name,
                                          why));
    simulation.scene = decode_scene(view.get("scene"), model, base);
  } catch (const std::invalid_argument& error) {
    own.value_or(view).fail(error.what());
  }
}

void read_course(const JsonView& view, SimulationSettings& simulation) {
  read(view, "frames", simulation.frames, std::numeric_limits<std::uint32_t>::max());
  read(view, "free_seconds", simulation.free_seconds, non_negative);
  read_seed(view, simulation.seed);
  if (const auto accuracy = view.find("accuracy"))
    simulation.accuracy = static_cast<IntegratorAccuracy>(accuracy->one_of(accuracy_names));
  read(view, "paced", simulation.paced);
  read(view, "block_frames", simulation.block_frames, most_block_frames);
  if (const auto faults = view.find("faults")) simulation.faults = decode_faults(*faults);
}

// Fails at `pointer` ("/comb/…") of the section, or of the configuration when the section has taken it from
// there.
[[noreturn]] void fail_at(const JsonView& view, const std::string& pointer, const std::string& message) {
  if (pointer.empty()) view.fail(message);
  const std::string key = pointer.substr(1, pointer.find('/', 1) - 1);
  JsonView(view.json(), view.file(), (view.find(key) ? view.pointer() : "") + pointer).fail(message);
}

void check_list(const JsonView& view, const char* pointer, const std::vector<double>& list,
                std::size_t driven) {
  if (list.size() != driven)
    fail_at(view, pointer,
            fmt::format("has {} elements, must have {}, one a driven tone", list.size(), driven));
}

void check(const JsonView& view, const SimulationSettings& simulation) {
  Description description;
  description.comb = simulation.comb;
  description.scan = simulation.layout;
  if (const auto fault = find_contradiction(description)) fail_at(view, fault->pointer, fault->message);
  const auto& tones = simulation.comb.tones;
  const auto driven =
      static_cast<std::size_t>(std::ranges::count_if(tones, [](const Tone& tone) { return tone.driven; }));
  if (driven == 0) fail_at(view, "/comb/tones", "has no driven tone, must have at least one");
  if (simulation.feedback.enabled && !tones.front().driven)
    fail_at(view, "/comb/tones/0/driven", "is false, must be true: the feedback acts on the first tone");
  if (simulation.drive.scheme == DriveScheme::amplitudes)
    check_list(view, "/drive/amplitudes_nm", simulation.drive.amplitudes_nm, driven);
  if (!simulation.drive.phases_rad.empty())
    check_list(view, "/drive/phases_rad", simulation.drive.phases_rad, driven);
  try {
    validate(simulation);
    check_scene(simulation.scene, find_model(simulation.model), simulation.layout);
  } catch (const std::invalid_argument& error) {
    const FieldMessage refused = split_field(error.what(), "simulation.");
    fail_at(view, refused.pointer, refused.message);
  }
}

Json encode_by_parameter(const ModelInfo& model, const auto& values) {
  Json object = Json::object();
  const auto parameters = material_parameters(model);
  for (std::size_t i = 0; i < parameters.size(); ++i) object[std::string(parameters[i].name)] = values.at(i);
  return object;
}

Json encode(const SceneSettings& scene, const ModelInfo& model) {
  Json object{{"kind", name_of(scene_names, scene.kind)}};
  if (scene.kind == SceneSettings::Kind::maps) {
    object["height_map"] = scene.height_map;
    object["parameter_maps"] = encode_by_parameter(model, scene.parameter_maps);
    return object;
  }
  object["materials"] = Json::array();
  for (const auto& material : scene.materials)
    object["materials"].push_back(encode_by_parameter(model, material.parameters));
  if (scene.kind == SceneSettings::Kind::blend) {
    object["step_nm"] = scene.step_nm;
    object["grain_nm"] = scene.grain_nm;
    object["domain_nm"] = scene.domain_nm;
    object["seed"] = scene.seed;
  }
  return object;
}

Json encode(const FeedbackSettings& feedback) {
  return Json{{"enabled", feedback.enabled},
              {"set_point", feedback.set_point},
              {"gain", feedback.gain},
              {"start_z_nm", feedback.start_z_nm}};
}

Json encode(const std::vector<FaultSettings>& faults) {
  Json list = Json::array();
  for (const auto& fault : faults) {
    Json object{{"kind", name_of(fault_names, fault.kind)}, {"sample", fault.sample}};
    if (fault.kind == FaultSettings::Kind::stall) {
      object["duration_s"] = fault.duration_s;
    } else if (fault.kind == FaultSettings::Kind::detuned) {
      object["detuning_ppm"] = fault.detuning_ppm;
    } else {
      object["frames"] = fault.frames;
    }
    list.push_back(std::move(object));
  }
  return list;
}

}  // namespace

SimulationSettings decode_simulation(const JsonView& view, const Description& top,
                                     const std::filesystem::path& base) {
  view.only({"sample_rate_hz", "cantilever", "comb", "drive", "model", "scene", "feedback", "scan", "frames",
             "temperature_k", "detector_nm_per_sqrt_hz", "volts_per_code", "z_nm_per_code", "free_seconds",
             "seed", "accuracy", "paced", "block_frames", "faults"});
  SimulationSettings simulation;
  read_instrument(view, top, simulation);
  read_surface(view, top, base, simulation);
  read_course(view, simulation);
  check(view, simulation);
  return simulation;
}

Json encode(const SimulationSettings& simulation) {
  return Json{{"sample_rate_hz", simulation.sample_rate_hz},
              {"cantilever", encode(simulation.cantilever)},
              {"comb", encode(simulation.comb)},
              {"drive", encode(simulation.drive)},
              {"model", simulation.model},
              {"scene", encode(simulation.scene, find_model(simulation.model))},
              {"feedback", encode(simulation.feedback)},
              {"scan", encode(simulation.layout)},
              {"frames", simulation.frames},
              {"temperature_k", simulation.temperature_k},
              {"detector_nm_per_sqrt_hz", simulation.detector_nm_per_sqrt_hz},
              {"volts_per_code", simulation.volts_per_code},
              {"z_nm_per_code", simulation.z_nm_per_code},
              {"free_seconds", simulation.free_seconds},
              {"seed", simulation.seed},
              {"accuracy", name_of(accuracy_names, simulation.accuracy)},
              {"paced", simulation.paced},
              {"block_frames", simulation.block_frames},
              {"faults", encode(simulation.faults)}};
}

std::string resolve_path(const JsonView& path, const std::filesystem::path& base) {
  const std::string text = path.string();
  if (text.empty()) path.fail("is empty, must name a file");
  return (base / text).lexically_normal().string();
}

}  // namespace combforce

#include "fit/material.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <stdexcept>

#include "fit/capillary.hpp"
#include "fit/cone.hpp"
#include "fit/dlvo.hpp"
#include "fit/dmt.hpp"
#include "fit/flat_punch.hpp"
#include "fit/hertz.hpp"
#include "fit/jkr.hpp"
#include "fit/kelvin_voigt.hpp"
#include "fit/lennard_jones.hpp"

namespace combforce {
namespace {

constexpr double dmt_below = 0.1, jkr_above = 5.0;  // of Tabor's number

std::optional<double> reduced_modulus(const ModelInfo& model, double strength, const TipGeometry& tip) {
  const auto is = [&](const ModelInfo& other) { return model.name == other.name; };
  if (is(Cone::model) && tip.half_angle_deg)
    return std::numbers::pi * strength / (2.0 * std::tan(*tip.half_angle_deg * std::numbers::pi / 180.0));
  if (!tip.radius_nm) return std::nullopt;
  if (is(FlatPunch::model)) return strength / (2.0 * *tip.radius_nm);
  if (is(Hertz::model) || is(Dmt::model) || is(Jkr::model) || is(KelvinVoigt::model) || is(Capillary::model))
    return 0.75 * strength / std::sqrt(*tip.radius_nm);
  return std::nullopt;
}

std::optional<double> young_modulus(double reduced_gpa, const TipGeometry& tip) {
  if (!tip.sample_poisson_ratio) return std::nullopt;
  const double tip_compliance =
      tip.tip_young_modulus_gpa
          ? (1.0 - tip.tip_poisson_ratio * tip.tip_poisson_ratio) / *tip.tip_young_modulus_gpa
          : 0.0;
  const double compliance = 1.0 / reduced_gpa - tip_compliance;
  if (!(compliance > 0.0)) return std::nullopt;
  return (1.0 - *tip.sample_poisson_ratio * *tip.sample_poisson_ratio) / compliance;
}

void require(bool holds, const char* field, double value, const char* bound) {
  if (!holds) throw std::invalid_argument(fmt::format("tip.{}: {}, must be {}", field, value, bound));
}

}  // namespace

void validate(const TipGeometry& tip) {
  const auto positive = [](double value) { return value > 0.0 && std::isfinite(value); };
  const auto poisson = [](double value) { return value >= -1.0 && value <= 0.5; };
  if (tip.radius_nm) require(positive(*tip.radius_nm), "radius_nm", *tip.radius_nm, "positive and finite");
  if (tip.half_angle_deg)
    require(*tip.half_angle_deg > 0.0 && *tip.half_angle_deg < 90.0, "half_angle_deg", *tip.half_angle_deg,
            "between 0 and 90");
  if (tip.sample_poisson_ratio)
    require(poisson(*tip.sample_poisson_ratio), "sample_poisson_ratio", *tip.sample_poisson_ratio,
            "from -1 to 0.5");
  if (tip.tip_young_modulus_gpa)
    require(positive(*tip.tip_young_modulus_gpa), "tip_young_modulus_gpa", *tip.tip_young_modulus_gpa,
            "positive and finite");
  require(poisson(tip.tip_poisson_ratio), "tip_poisson_ratio", tip.tip_poisson_ratio, "from -1 to 0.5");
}

std::array<NamedQuantity, 5> quantities(const MaterialParameters& material) {
  return {{{"reduced_modulus_gpa", material.reduced_modulus_gpa},
           {"young_modulus_gpa", material.young_modulus_gpa},
           {"hamaker_zj", material.hamaker_zj},
           {"work_of_adhesion_mj_per_m2", material.work_of_adhesion_mj_per_m2},
           {"tabor_number", material.tabor_number}}};
}

std::string_view to_string(AdhesionTheory theory) {
  return theory == AdhesionTheory::dmt ? "dmt" : theory == AdhesionTheory::jkr ? "jkr" : "transition";
}

MaterialParameters material_of(const ModelInfo& model, std::span<const double> parameters,
                               const TipGeometry& tip) {
  constexpr double zj_per_nn_nm = 1e3, mj_per_m2_per_nn_per_nm = 1e3;
  MaterialParameters material;
  if (model.name == LennardJones::model.name || model.name == Dlvo::model.name) {
    const double strength = model.name == Dlvo::model.name
                                ? parameters[3] * Dlvo::cut_off_nm * Dlvo::cut_off_nm
                                : parameters[1];  // H R/6
    if (tip.radius_nm) material.hamaker_zj = zj_per_nn_nm * 6.0 * strength / *tip.radius_nm;
    return material;
  }
  material.reduced_modulus_gpa = reduced_modulus(model, parameters[1], tip);
  if (material.reduced_modulus_gpa)
    material.young_modulus_gpa = young_modulus(*material.reduced_modulus_gpa, tip);
  if (model.name == Jkr::model.name && tip.radius_nm)
    material.work_of_adhesion_mj_per_m2 =
        mj_per_m2_per_nn_per_nm * 2.0 * parameters[2] / (3.0 * std::numbers::pi * *tip.radius_nm);
  if (model.name != Dmt::model.name || !tip.radius_nm) return material;
  const double radius = *tip.radius_nm, adhesion = parameters[2], range = parameters[3];
  const double work = adhesion / (2.0 * std::numbers::pi * radius);
  const double stiffness = *material.reduced_modulus_gpa;
  material.hamaker_zj = zj_per_nn_nm * 6.0 * adhesion * range * range / radius;
  material.work_of_adhesion_mj_per_m2 = mj_per_m2_per_nn_per_nm * work;
  material.tabor_number = std::cbrt(radius * work * work / (stiffness * stiffness)) / range;
  material.theory = *material.tabor_number < dmt_below   ? AdhesionTheory::dmt
                    : *material.tabor_number > jkr_above ? AdhesionTheory::jkr
                                                         : AdhesionTheory::transition;
  return material;
}

}  // namespace combforce

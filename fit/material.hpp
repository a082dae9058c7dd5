// What a fit says of the material, where the shape of the tip and the Poisson ratios are known.
//
//     1/E* = (1 - nu^2)/E + (1 - nu_tip^2)/E_tip
//     E* = 3 p1/(4 sqrt(R))         Hertz, DMT, JKR, Kelvin-Voigt, capillary
//     E* = pi p1/(2 tan(theta))     cone
//     E* = p1/(2 a)                 flat punch
//     H  = 6 p2 p3^2/R              DMT: Hamaker's constant
//     H  = 6 p1/R                   Lennard-Jones
//     H  = 6 p3 D0^2/R              DLVO
//     w  = p2/(2 pi R)              DMT: work of adhesion, from the pull-off force 2 pi w R
//     w  = 2 p2/(3 pi R)            JKR: from its pull-off force (3/2) pi w R
//     mu = (R w^2/(E*^2 p3^3))^(1/3)   Tabor's number (Tabor 1977, J. Colloid Interface Sci. 58, 2), with the
//                                   contact distance p3 as the range of the attraction; absent for JKR, which
//                                   has no range
//
// Which theory of adhesive contact a Tabor number asks for: DMT below 0.1, JKR above 5 (Johnson, Greenwood
// 1997, J. Colloid Interface Sci. 192, 326); neither is right between.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "fit/force_model.hpp"

namespace combforce {

struct TipGeometry {
  std::optional<double> radius_nm;             // R, of the apex; a flat punch's a; > 0
  std::optional<double> half_angle_deg;        // theta of a cone, from its axis; 0 … 90, exclusive
  std::optional<double> sample_poisson_ratio;  // nu; -1 … 0.5
  // Absent: the tip is rigid.
  std::optional<double> tip_young_modulus_gpa;  // E_tip, > 0
  double tip_poisson_ratio = 0.27;              // silicon, <110>

  bool operator==(const TipGeometry&) const = default;
};

// Throws std::invalid_argument naming field, value and bound.
void validate(const TipGeometry& tip);

enum class AdhesionTheory : std::uint8_t { dmt, transition, jkr };

// Absent: the model does not say, or the geometry is not known. E is absent too where E* exceeds what the tip
// alone would give.
struct MaterialParameters {
  std::optional<double> reduced_modulus_gpa;         // E*
  std::optional<double> young_modulus_gpa;           // E
  std::optional<double> hamaker_zj;                  // H, 1e-21 J
  std::optional<double> work_of_adhesion_mj_per_m2;  // w, 1e-3 J/m^2
  std::optional<double> tabor_number;                // mu
  std::optional<AdhesionTheory> theory;              // that mu asks for
};

// The quantities by name, with their unit, in the order above; `theory` is not one.
struct NamedQuantity {
  std::string_view name;
  std::optional<double> value;
};
std::array<NamedQuantity, 5> quantities(const MaterialParameters& material);

// "dmt", "transition", "jkr".
std::string_view to_string(AdhesionTheory theory);

// `parameters`: in the model's order.
MaterialParameters material_of(const ModelInfo& model, std::span<const double> parameters,
                               const TipGeometry& tip);

}  // namespace combforce

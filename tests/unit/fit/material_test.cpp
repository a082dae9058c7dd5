// Material parameters: contacts of known moduli, forward by the formulas of the field, come back.
#include "fit/material.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <stdexcept>
#include <vector>

namespace combforce {
namespace {

using std::numbers::pi;

TipGeometry tip_of(double radius_nm) {
  TipGeometry tip;
  tip.radius_nm = radius_nm;
  tip.sample_poisson_ratio = 0.35;
  return tip;
}

// Polystyrene of 3 GPa under a silicon sphere of 10 nm: 1/E* = (1 - 0.35^2)/3 + (1 - 0.27^2)/170.
TEST(Material, ModulusOfASphereOfSilicon) {
  TipGeometry tip = tip_of(10.0);
  tip.tip_young_modulus_gpa = 170.0;
  const double reduced = 1.0 / (0.8775 / 3.0 + 0.9271 / 170.0);
  const std::vector<double> p{-40.0, 4.0 / 3.0 * reduced * std::sqrt(10.0)};
  const MaterialParameters material = material_of(find_model("hertz"), p, tip);
  EXPECT_NEAR(*material.reduced_modulus_gpa, reduced, 1e-12);
  EXPECT_NEAR(*material.young_modulus_gpa, 3.0, 1e-12);
  EXPECT_FALSE(material.hamaker_zj);
  EXPECT_FALSE(material.tabor_number);
  EXPECT_NEAR(*material_of(find_model("kelvin_voigt"), std::vector{p[0], p[1], 0.1}, tip).young_modulus_gpa,
              3.0, 1e-12);
}

TEST(Material, ModulusOfARigidConeAndPunch) {
  TipGeometry tip;
  tip.half_angle_deg = 30.0;
  tip.sample_poisson_ratio = 0.5;
  EXPECT_NEAR(*material_of(find_model("cone"), std::vector{0.0, 2.0 / pi * 4.0 / std::sqrt(3.0)}, tip)
                   .young_modulus_gpa,
              0.75 * 4.0, 1e-12);
  EXPECT_FALSE(material_of(find_model("flat_punch"), std::vector{0.0, 1.0}, tip).reduced_modulus_gpa);
  tip.radius_nm = 5.0;
  EXPECT_NEAR(
      *material_of(find_model("flat_punch"), std::vector{0.0, 2.0 * 4.0 * 5.0}, tip).reduced_modulus_gpa, 4.0,
      1e-12);
}

// H = 0.1 aJ, R = 10 nm, a contact distance of 0.2 nm: p2 = H R/(6 p3^2) = 4.1667 nN.
TEST(Material, AdhesionOfDmt) {
  const double p2 = 0.1 * 10.0 / (6.0 * 0.04), reduced = 3.0;
  const std::vector<double> p{-40.0, 4.0 / 3.0 * reduced * std::sqrt(10.0), p2, 0.2};
  const MaterialParameters material = material_of(find_model("dmt"), p, tip_of(10.0));
  EXPECT_NEAR(*material.hamaker_zj, 100.0, 1e-9);
  // w = H/(12 pi z0^2) for half-spaces at contact (Israelachvili).
  EXPECT_NEAR(*material.work_of_adhesion_mj_per_m2, 1e3 * 0.1 / (12.0 * pi * 0.04), 1e-9);
  const double w = 1e-3 * *material.work_of_adhesion_mj_per_m2;
  EXPECT_NEAR(std::pow(*material.tabor_number, 3.0), 10.0 * w * w / (9.0 * 0.008), 1e-12);
  EXPECT_EQ(material.theory, AdhesionTheory::transition);
}

// w = 50 mJ/m^2, R = 10 nm: a pull-off force of (3/2) pi 0.05 nN/nm 10 nm.
TEST(Material, AdhesionOfJkr) {
  const std::vector<double> p{-40.0, 4.0 / 3.0 * 2.0 * std::sqrt(10.0), 1.5 * pi * 0.05 * 10.0};
  const MaterialParameters material = material_of(find_model("jkr"), p, tip_of(10.0));
  EXPECT_NEAR(*material.reduced_modulus_gpa, 2.0, 1e-12);
  EXPECT_NEAR(*material.work_of_adhesion_mj_per_m2, 50.0, 1e-9);
  EXPECT_FALSE(material.tabor_number);
  EXPECT_FALSE(material.hamaker_zj);
}

TEST(Material, HamakerOfLennardJones) {
  const std::vector<double> p{-40.0, 0.1 * 10.0 / 6.0, 0.34};
  EXPECT_NEAR(*material_of(find_model("lennard_jones"), p, tip_of(10.0)).hamaker_zj, 100.0, 1e-9);
}

// H R/(6 D0^2) with D0 = 0.165 nm of 100 zJ and 10 nm is 6.122 nN.
TEST(Material, HamakerOfDlvo) {
  const std::vector<double> p{-40.0, 1.0, 2.0, 0.1 * 10.0 / (6.0 * 0.165 * 0.165)};
  EXPECT_NEAR(p[3], 6.122, 1e-3);
  EXPECT_NEAR(*material_of(find_model("dlvo"), p, tip_of(10.0)).hamaker_zj, 100.0, 1e-9);
}

TEST(Material, TheTaborNumberSaysWhichTheory) {
  const auto theory = [](double p1, double p2) {
    return material_of(find_model("dmt"), std::vector{-40.0, p1, p2, 0.2}, tip_of(10.0)).theory;
  };
  EXPECT_EQ(theory(500.0, 1.0), AdhesionTheory::dmt);  // hard and dry
  EXPECT_EQ(theory(0.01, 10.0), AdhesionTheory::jkr);  // a soft rubber
}

TEST(Material, WhatIsNotKnownIsAbsent) {
  const std::vector<double> p{-40.0, 1.0, 5.0, 0.5};
  const MaterialParameters nothing = material_of(find_model("dmt"), p, {});
  EXPECT_FALSE(nothing.reduced_modulus_gpa || nothing.young_modulus_gpa || nothing.hamaker_zj ||
               nothing.work_of_adhesion_mj_per_m2 || nothing.tabor_number || nothing.theory);
  TipGeometry tip;
  tip.radius_nm = 10.0;
  EXPECT_FALSE(material_of(find_model("dmt"), p, tip).young_modulus_gpa);
  tip.sample_poisson_ratio = 0.3;
  tip.tip_young_modulus_gpa = 0.1;  // softer than the contact
  EXPECT_TRUE(material_of(find_model("dmt"), p, tip).reduced_modulus_gpa);
  EXPECT_FALSE(material_of(find_model("dmt"), p, tip).young_modulus_gpa);
}

TEST(Material, WrongGeometryIsNamed) {
  const auto message = [](TipGeometry tip) -> std::string {
    try {
      validate(tip);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  TipGeometry tip;
  EXPECT_EQ(message(tip), "");
  tip.radius_nm = 0.0;
  EXPECT_THAT(message(tip), testing::HasSubstr("tip.radius_nm: 0, must be positive"));
  tip.radius_nm = 10.0;
  tip.half_angle_deg = 90.0;
  EXPECT_THAT(message(tip), testing::HasSubstr("tip.half_angle_deg: 90"));
  tip.half_angle_deg = 20.0;
  tip.sample_poisson_ratio = 0.6;
  EXPECT_THAT(message(tip), testing::HasSubstr("tip.sample_poisson_ratio: 0.6"));
}

}  // namespace
}  // namespace combforce

// Every model of the list but polynomials (polynomial_test.cpp): the terms that fits integrate against the
// formula, its automatic derivative and finite differences; the formulas against the paper's; look-up by
// name.
#include "fit/force_model.hpp"

#include <ceres/jet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <stdexcept>
#include <type_traits>

#include "fit/model_list.hpp"

namespace combforce {
namespace {

template <typename Tuple>
struct TypesOf;
template <typename... Models>
struct TypesOf<std::tuple<Models...>> {
  using Types = testing::Types<Models...>;
  using Searched = decltype(std::tuple_cat(
      std::conditional_t<NeedsSearch<Models>, std::tuple<Models>, std::tuple<>>{}...));
};

template <typename Model>
class EveryModel : public testing::Test {
 protected:
  static constexpr std::size_t count = Model::parameters;
  using Parameters = std::array<double, count>;

  // Strengths and lengths over four decades about 1, within their bounds.
  Parameters parameters() {
    Parameters p;
    for (std::size_t k = 0; k < count; ++k) {
      const ParameterInfo& info = Model::info[k];
      p[k] = info.lower > 0.0 ? std::clamp(exponential(1e-2, 1e2), info.lower, info.upper)
                              : uniform(-50.0, 50.0);
    }
    return p;
  }
  // From the surface, where tips are: above a pole, not far below where a force grows exponentially, not yet
  // let go where they are held.
  double distance_nm([[maybe_unused]] const Parameters& p) {
    const double distance = exponential(StaysAboveSurface<Model> ? 0.1 : 1e-3, 1e2);
    if constexpr (DependsOnHistory<Model>)
      return std::min(distance, 0.5 * Model::release_height_nm(p.data()));
    else if constexpr (std::is_same_v<Model, Dlvo>)
      return std::min(distance, 20.0 * p[2]);
    else if constexpr (Decays<Model>)
      return std::min(distance, 20.0 * p[Model::decay]);
    else
      return distance;
  }
  // On which forces change, of the distance.
  static constexpr double smooth_share = StaysAboveSurface<Model> || DependsOnHistory<Model> ? 0.1
                                         : std::is_same_v<Model, Dlvo> || Decays<Model>      ? 0.03
                                                                                             : 1.0;
  // Below and above what the paper's cantilever reaches, 4e7 nm/s; either direction.
  double velocity_nm_per_s() { return exponential(1e5, 1e8) * (uniform(0.0, 1.0) < 0.5 ? -1.0 : 1.0); }

  // F, its derivatives with respect to the parameters and the velocity as fits put them together from the
  // model's terms.
  static std::array<double, 2 + count> by_terms(const Parameters& p, double d, double velocity) {
    if (d <= p[0]) return sum(p, Model::contact_terms, contact_of<Model>(p.data(), p[0] - d, velocity));
    if constexpr (Model::tail_terms.empty())
      return {};
    else
      return sum(p, Model::tail_terms, Model::tail(p.data(), d - p[0]));
  }

  std::mt19937 random_{7};

 private:
  double uniform(double low, double high) { return std::uniform_real_distribution(low, high)(random_); }
  double exponential(double low, double high) { return std::exp(uniform(std::log(low), std::log(high))); }

  template <std::size_t Terms>
  static std::array<double, 2 + count> sum(const Parameters& p, const std::array<ModelTerm, Terms>& terms,
                                           const std::array<double, Terms>& values) {
    std::array<double, 2 + count> result{};
    for (std::size_t j = 0; j < Terms; ++j) {
      const auto [linear, derivative] = terms[j];
      if (derivative == value_of_term) {
        result[0] += coefficient(p.data(), terms[j]) * values[j];
        if (linear != unit_coefficient) result[1 + linear] += values[j];
      } else {
        result[derivative == velocity_of_term ? 1 + count : 1 + derivative] +=
            coefficient(p.data(), terms[j]) * values[j];
      }
    }
    return result;
  }
};
TYPED_TEST_SUITE(EveryModel, TypesOf<TypesOf<ForceModels>::Searched>::Types);

TYPED_TEST(EveryModel, TermsAddUpToTheForceAndItsAutomaticDerivatives) {
  using Jet = ceres::Jet<double, static_cast<int>(TypeParam::parameters)>;
  for (int i = 0; i < 2000; ++i) {
    const auto p = this->parameters();
    const double distance = this->distance_nm(p), d = p[0] + (i % 2 == 0 ? distance : -distance);
    std::array<Jet, TypeParam::parameters> jets;
    for (std::size_t k = 0; k < this->count; ++k) jets[k] = Jet(p[k], static_cast<int>(k));
    const double velocity = this->velocity_nm_per_s();
    const Jet expected = force_of<TypeParam>(jets.data(), Jet(d), velocity, true);
    const auto terms = this->by_terms(p, d, velocity);
    // Rounding: p0 - d loses 1e-14 nm of |p0| <= 50 nm, that is 1e-11 of the least distance; adhesion and
    // contact may cancel, hence the scale.
    const double scale = std::abs(expected.a) + std::abs(p[this->count - 2]) + std::abs(p[1]);
    EXPECT_NEAR(terms[0], expected.a, 1e-10 * scale);
    for (std::size_t k = 0; k < this->count; ++k)
      EXPECT_NEAR(terms[1 + k], expected.v[static_cast<int>(k)],
                  1e-10 * (scale + std::abs(expected.v[static_cast<int>(k)])))
          << "p" << k << " at distance " << d - p[0];
  }
}

TYPED_TEST(EveryModel, DerivativesAreFiniteDifferences) {
  for (int i = 0; i < 2000; ++i) {
    const auto p = this->parameters();
    const double distance = this->distance_nm(p), d = p[0] + (i % 2 == 0 ? distance : -distance);
    const double velocity = this->velocity_nm_per_s();
    const auto terms = this->by_terms(p, d, velocity);
    for (std::size_t k = 0; k <= this->count; ++k) {
      const bool of_velocity = k == this->count;
      if (of_velocity && !DependsOnVelocity<TypeParam>) continue;
      // Steps a hundredth of the scale on which the force changes, which never cross the surface.
      const double step = 1e-2 * this->smooth_share *
                          (k == 0        ? distance
                           : of_velocity ? std::abs(velocity)
                                         : std::min(p[k], 1.0 + distance));
      const auto shifted = [&](double steps) {
        auto q = p;
        if (!of_velocity) q[k] += steps * step;
        return force_of<TypeParam>(q.data(), d, of_velocity ? velocity + steps * step : velocity, true);
      };
      // Steps that would cross where a force is clamped say nothing.
      if ((shifted(-2.0) == 0.0) != (shifted(2.0) == 0.0)) continue;
      const double difference =
          (8.0 * (shifted(1.0) - shifted(-1.0)) - (shifted(2.0) - shifted(-2.0))) / (12.0 * step);
      // Fourth order: (1e-2)^4 times a few, and rounding of F by 1e-15 (1e-11 by p0 - d) over the step.
      const double largest = std::max({std::abs(shifted(-2.0)), std::abs(shifted(2.0)), p[this->count - 2]});
      EXPECT_NEAR(terms[1 + k], difference, 1e-7 * std::abs(difference) + 1e-8 * largest / step)
          << "p" << k << " at distance " << d - p[0];
    }
  }
}

// A side of the surface on which a model lists no term has no force.
TYPED_TEST(EveryModel, IsContinuousAtTheSurface) {
  if (StaysAboveSurface<TypeParam>) GTEST_SKIP() << "a pole";
  for (int i = 0; i < 100; ++i) {
    auto p = this->parameters();
    p[0] = 0.0;
    const double above = force_of<TypeParam>(p.data(), 1e-9, 0.0, true),
                 below = force_of<TypeParam>(p.data(), -1e-9, 0.0, true);
    // Slopes of at most 2 p2/p3 <= 2e4 nN/nm over 2e-9 nm.
    EXPECT_NEAR(above, below, 1e-4 * (1.0 + std::abs(above)));
    if (TypeParam::tail_terms.empty()) {
      EXPECT_EQ(above, 0.0);
    }
  }
}

TEST(Hertz, IsThePapersEquation15) {
  const std::array<double, 2> p{-40.0, 1.5};
  EXPECT_DOUBLE_EQ(Hertz::force(p.data(), -44.0), 1.5 * 8.0);
  EXPECT_EQ(Hertz::force(p.data(), -39.0), 0.0);
  EXPECT_EQ(Hertz::force(p.data(), -40.0), 0.0);
}

TEST(Dmt, IsThePapersEquation16) {
  const std::array<double, 4> p{-40.0, 1.5, 5.0, 0.5};
  EXPECT_DOUBLE_EQ(Dmt::force(p.data(), -44.0), -5.0 + 1.5 * 8.0);
  EXPECT_DOUBLE_EQ(Dmt::force(p.data(), -40.0), -5.0);
  EXPECT_DOUBLE_EQ(Dmt::force(p.data(), -39.5), -5.0 / 4.0);
  EXPECT_DOUBLE_EQ(Dmt::force(p.data(), -38.5), -5.0 / 16.0);
  EXPECT_DOUBLE_EQ(Dmt::tail_length(p.data()), 0.5);
}

TEST(Cone, IsSneddonsForce) {
  const std::array<double, 2> p{-40.0, 0.5};
  EXPECT_DOUBLE_EQ(Cone::force(p.data(), -44.0), 0.5 * 16.0);
  EXPECT_EQ(Cone::force(p.data(), -40.0), 0.0);
}

TEST(FlatPunch, IsSneddonsForce) {
  const std::array<double, 2> p{-40.0, 0.5};
  EXPECT_DOUBLE_EQ(FlatPunch::force(p.data(), -44.0), 0.5 * 4.0);
  EXPECT_EQ(FlatPunch::force(p.data(), -40.0), 0.0);
}

// F = 0 where z^6 = sigma^6/30; the deepest well, where 8 sigma^6/30 = 2 z^6, is 3/4 of -1/z^2 deep.
// At depth 0, and where contact is lost, the forces are -8/9 and -5/9 of the pull-off force.
TEST(Jkr, IsTheTextbooksOnBothBranches) {
  const std::array<double, 3> p{-40.0, 1.5, 5.0};
  EXPECT_NEAR(Jkr::force(p.data(), -40.0 - 1e-12, false), -8.0 / 9.0 * 5.0, 1e-9);
  EXPECT_EQ(Jkr::force(p.data(), -40.0 + 1e-9, false), 0.0);
  const double release = Jkr::release_height_nm(p.data());
  EXPECT_NEAR(release, 3.0 * std::pow(5.0 / (9.0 * 1.5), 2.0 / 3.0), 1e-12);
  EXPECT_NEAR(Jkr::force(p.data(), -40.0 + release * (1.0 - 1e-12), true), -5.0 / 9.0 * 5.0, 1e-4);
  EXPECT_EQ(Jkr::force(p.data(), -40.0 + release + 1e-9, true), 0.0);
  // s = 3 nm^(1/2): depth 9 - 4/3 sqrt(10), force 40.5 - 2 sqrt(7.5 * 27).
  EXPECT_NEAR(Jkr::force(p.data(), -49.0 + 4.0 / 3.0 * std::sqrt(10.0), false), 40.5 - 2.0 * std::sqrt(202.5),
              1e-11);
  EXPECT_EQ(model_force(find_model("jkr"), p, -39.5), 0.0);
  EXPECT_EQ(model_force(find_model("jkr"), p, -39.5, 0.0, true), Jkr::force(p.data(), -39.5, true));
  EXPECT_TRUE(depends_on_history(find_model("jkr")));
  EXPECT_FALSE(depends_on_history(find_model("dmt")));
}

// At z = p3 the meniscus pulls with 1 - 1/sqrt(2) of its force.
TEST(Capillary, PullsUntilTheMeniscusRuptures) {
  const std::array<double, 5> p{-40.0, 1.5, 5.0, 2.0, 3.0};
  EXPECT_DOUBLE_EQ(Capillary::force(p.data(), -44.0, false), 1.5 * 8.0 - 5.0);
  EXPECT_EQ(Capillary::force(p.data(), -39.0, false), 0.0);
  EXPECT_DOUBLE_EQ(Capillary::force(p.data(), -38.0, true), -5.0 * (1.0 - 1.0 / std::sqrt(2.0)));
  EXPECT_LT(Capillary::force(p.data(), -37.0 - 1e-9, true), 0.0);
  EXPECT_EQ(Capillary::force(p.data(), -37.0 + 1e-9, true), 0.0);
}

TEST(LennardJones, HasItsZeroAndItsWellWhereTheFormulaSays) {
  const std::array<double, 3> p{-40.0, 0.2, 0.34};
  const double zero = 0.34 / std::pow(30.0, 1.0 / 6.0), well = zero * std::pow(4.0, 1.0 / 6.0);
  EXPECT_NEAR(LennardJones::force(p.data(), -40.0 + zero), 0.0, 1e-9);
  EXPECT_NEAR(LennardJones::force(p.data(), -40.0 + well), -0.75 * 0.2 / (well * well), 1e-9);
  EXPECT_LT(LennardJones::force(p.data(), -40.0 + 1.01 * well), 0.0);
  EXPECT_GT(LennardJones::force(p.data(), -41.0), 1e6);
}

TEST(Dlvo, IsTheRepulsionLessTheAttraction) {
  const std::array<double, 4> p{-40.0, 2.0, 1.5, 3.0};
  EXPECT_DOUBLE_EQ(Dlvo::force(p.data(), -40.0), 2.0 - 3.0);
  EXPECT_DOUBLE_EQ(Dlvo::force(p.data(), -38.5), 2.0 / std::exp(1.0) - 3.0 * std::pow(0.165 / 1.665, 2));
  EXPECT_DOUBLE_EQ(Dlvo::force(p.data(), -41.5), 2.0 * std::exp(1.0) - 3.0);
}

TEST(Exponential, IsOneNanonewtonAtItsPositionAndFallsByEOverItsDecayLength) {
  const std::array<double, 2> p{-40.0, 2.5};
  EXPECT_DOUBLE_EQ(Exponential::force(p.data(), -40.0), 1.0);
  EXPECT_DOUBLE_EQ(Exponential::force(p.data(), -37.5), 1.0 / std::numbers::e);
  EXPECT_DOUBLE_EQ(Exponential::force(p.data(), -45.0), std::numbers::e * std::numbers::e);
  EXPECT_DOUBLE_EQ(Exponential::force(p.data(), -500.0), std::exp(30.0));
}

TEST(KelvinVoigt, IsHertzAtRestStifferGoingInAndLetsGoGoingOut) {
  const std::array<double, 3> p{-40.0, 2.0, 0.1};
  EXPECT_DOUBLE_EQ(KelvinVoigt::force(p.data(), -44.0, 0.0), 2.0 * 8.0);
  // 10 nm/us inwards: 3/2 * 0.1 us * 2 nm^(1/2) * 10 nm/us = 3 nm^(3/2) more.
  EXPECT_DOUBLE_EQ(KelvinVoigt::force(p.data(), -44.0, -10e6), 2.0 * (8.0 + 3.0));
  EXPECT_DOUBLE_EQ(KelvinVoigt::force(p.data(), -44.0, 10e6), 2.0 * (8.0 - 3.0));
  EXPECT_EQ(KelvinVoigt::force(p.data(), -44.0, 40e6), 0.0);  // 4 nm < 3/2 * 0.1 us * 40 nm/us
  EXPECT_EQ(KelvinVoigt::force(p.data(), -39.0, -10e6), 0.0);
  EXPECT_EQ(model_force(find_model("kelvin_voigt"), p, -44.0, -10e6),
            KelvinVoigt::force(p.data(), -44.0, -10e6));
}

TEST(ForceModels, AreFoundByNameAndDescribeThemselves) {
  for (const ModelInfo& info : force_models()) {
    EXPECT_EQ(&find_model(info.name), &info);
    EXPECT_FALSE(info.formula.empty());
    EXPECT_FALSE(info.source.empty());
    ASSERT_FALSE(info.parameters.empty());
    if (info.name != Polynomial::model.name) {
      EXPECT_EQ(info.parameters[0].name, "surface_position_nm");
    }
    for (const ParameterInfo& parameter : info.parameters) {
      EXPECT_LT(parameter.lower, parameter.upper) << parameter.name;
      EXPECT_GT(parameter.scale, 0.0) << parameter.name;
    }
  }
}

TEST(ForceModels, ForceByNameIsTheModels) {
  const std::array<double, 4> p{-40.0, 1.5, 5.0, 0.5};
  EXPECT_EQ(model_force(find_model("dmt"), p, -38.5), Dmt::force(p.data(), -38.5));
  EXPECT_EQ(model_force(find_model("hertz"), std::span(p).first(2), -44.0), Hertz::force(p.data(), -44.0));
}

TEST(ForceModels, WrongNamesAndCountsAreNamed) {
  using testing::AllOf;
  using testing::HasSubstr;
  EXPECT_THAT([] { find_model("herz"); }, testing::ThrowsMessage<std::invalid_argument>(AllOf(
                                              HasSubstr("herz"), HasSubstr("hertz"), HasSubstr("dmt"))));
  const std::array<double, 3> three{};
  EXPECT_THAT(
      [&] { model_force(find_model("dmt"), three, 0.0); },
      testing::ThrowsMessage<std::invalid_argument>(AllOf(HasSubstr("3"), HasSubstr("dmt"), HasSubstr("4"))));
}

}  // namespace
}  // namespace combforce

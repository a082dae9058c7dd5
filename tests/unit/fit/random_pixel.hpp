// Pixels at which the paper's error E is exactly 0 at known parameters: motions drawn about those of the
// paper, forces of a model along the partial motion by reference_force.hpp, and the free response that
// belongs to both.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "fit/dlvo.hpp"
#include "fit/dmt.hpp"
#include "fit/exponential.hpp"
#include "fit/hertz.hpp"
#include "fit/kelvin_voigt.hpp"
#include "fit/lennard_jones.hpp"
#include "tests/unit/fit/paper_cantilever.hpp"
#include "tests/unit/fit/reference_force.hpp"

namespace combforce::test {

struct ModelPixel {
  FitConditions conditions;
  Phasors tip_nm;
  std::vector<double> truth;
};

// F = chi^-1 (d - d_free): the free response from which these forces lead to these tones.
inline Phasors free_response_of(const FitConditions& conditions, const Phasors& tip_nm,
                                const Phasors& forces) {
  Phasors free_nm = tip_nm;
  const double delta_f_hz = conditions.sample_rate_hz / static_cast<double>(conditions.comb.window_samples);
  for (std::size_t i = 0; i < free_nm.size(); ++i)
    free_nm[i] -=
        tip_response(conditions.cantilever, static_cast<double>(conditions.comb.tones[i].bin) * delta_f_hz) *
        forces[i];
  return free_nm;
}

template <typename Model>
ModelPixel pixel_of(const std::vector<std::uint64_t>& bins, Phasors tip_nm, std::vector<double> truth) {
  const Phasors forces = reference_phasors<Model>(ReferenceMotion(bins, tip_nm, paper_delta_f_hz), truth);
  FitConditions conditions = paper_conditions(std::string(Model::model.name), bins, {});
  conditions.free_response->mean_nm = free_response_of(conditions, tip_nm, forces);
  return {std::move(conditions), std::move(tip_nm), std::move(truth)};
}

// Draws pixels one after the other; pixel n of a seed is the same on every machine (mt19937_64 and our own
// scaling: the standard's distributions are not).
class RandomPixels {
 public:
  explicit RandomPixels(std::uint64_t seed) : engine_(seed) {}

  // The paper's four drive tones, amplitudes between equal energy and equal amplitude.
  ModelPixel dmt() {
    const std::vector<std::uint64_t> bins{234, 1348, 3516, 6470};
    const std::vector<double> stiffnesses{4.0, 78.5, 366.0, 1330.0};
    Phasors tones = draw_tones(stiffnesses);
    std::vector<double> truth{uniform(-43.0, -37.0), uniform(0.4, 2.5), uniform(2.0, 9.0),
                              uniform(0.35, 0.8)};
    return pixel_of<Dmt>(bins, std::move(tones), std::move(truth));
  }

  ModelPixel hertz() { return contact<Hertz>(); }

  // At two tones p1 and p2 are hardly told apart: four, as for DMT.
  ModelPixel kelvin_voigt() {
    const std::vector<std::uint64_t> bins{234, 1348, 3516, 6470};
    const std::vector<double> stiffnesses{4.0, 78.5, 366.0, 1330.0};
    Phasors tones = draw_tones(stiffnesses);
    std::vector<double> truth{uniform(-43.0, -37.0), uniform(0.4, 2.5), uniform(0.01, 0.2)};
    return pixel_of<KelvinVoigt>(bins, std::move(tones), std::move(truth));
  }

  // Debye lengths of 100 to 4 mmol/l; the tip comes below closest approach. Around one mode, as for
  // Lennard-Jones: four incommensurate tones turn too seldom where these forces act.
  ModelPixel dlvo() {
    return around_one_mode<Dlvo>(12, [this](double lowest_nm) {
      const double debye = uniform(1.0, 5.0);
      return std::vector{lowest_nm + uniform(0.2, 1.0) * debye, uniform(1.0, 5.0), debye, uniform(0.5, 3.0)};
    });
  }

  // Hydration to double layers in dilute electrolytes; the greatest force is that of contact.
  ModelPixel exponential() {
    const std::vector<std::uint64_t> bins{234, 1348};
    const std::vector<double> stiffnesses{4.0, 78.5};
    Phasors tones = draw_tones(stiffnesses);
    const double decay = 0.2 * std::pow(100.0, uniform(0.0, 1.0));
    const double greatest_nn = 2.0 * std::pow(25.0, uniform(0.0, 1.0));
    const double p0 = ReferenceMotion(bins, tones).lowest_nm() + decay * std::log(greatest_nn);
    return pixel_of<Exponential>(bins, std::move(tones), {p0, decay});
  }

  // Turning points between the deepest attraction and some ten nanonewtons of repulsion.
  ModelPixel lennard_jones() {
    return around_one_mode<LennardJones>(12, [this](double lowest_nm) {
      const double sigma = uniform(0.25, 0.5), height = uniform(0.5, 0.7) * sigma;
      return std::vector{lowest_nm - height, uniform(0.05, 0.5), sigma};
    });
  }

  // Two parameters, two tones.
  template <typename Model>
  ModelPixel contact() {
    const std::vector<std::uint64_t> bins{234, 1348};
    const std::vector<double> stiffnesses{4.0, 78.5};
    Phasors tones = draw_tones(stiffnesses);
    return pixel_of<Model>(bins, std::move(tones), {uniform(-43.0, -37.0), uniform(0.4, 2.5)});
  }

  template <typename Model>
  ModelPixel intermodulation(std::size_t count) {
    return around_one_mode<Model>(count, [this](double lowest_nm) {
      std::vector<double> truth{lowest_nm + uniform(1.5, 6.0), uniform(0.4, 2.5), uniform(2.0, 9.0),
                                uniform(0.35, 0.8)};
      truth.resize(Model::parameters);
      return truth;
    });
  }

  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_() >> 11) * 0x1p-53);
  }

 private:
  // Two drive tones in the first mode's resonance and the products that contact makes of them, as many tones
  // as asked for about 117 kHz, weaker and weaker away from the drive. `draw_truth`: of the lowest turning
  // point.
  template <typename Model, typename DrawTruth>
  ModelPixel around_one_mode(std::size_t count, const DrawTruth& draw_truth) {
    std::vector<std::uint64_t> bins;
    Phasors tones;
    const double centre = 0.5 * static_cast<double>(count - 1);
    for (std::size_t i = 0; i < count; ++i) {
      bins.push_back(234 - count / 2 + i);
      const double away = std::abs(static_cast<double>(i) - centre);
      const double amplitude_nm = away < 1.0 ? 12.0 : 0.8 * std::pow(0.85, away) * uniform(0.5, 1.0);
      tones.push_back(std::polar(amplitude_nm, uniform(-std::numbers::pi, std::numbers::pi)));
    }
    std::vector<double> truth = draw_truth(ReferenceMotion(bins, tones).lowest_nm());
    return pixel_of<Model>(bins, std::move(tones), std::move(truth));
  }

  // Any phases; a sum of amplitudes of 46 to 50 nm, as contact leaves of the paper's 50.
  Phasors draw_tones(const std::vector<double>& stiffnesses) {
    const double exponent = uniform(-0.5, 0.0), total = uniform(46.0, 50.0);
    double sum = 0.0;
    for (const double stiffness : stiffnesses) sum += std::pow(stiffness, exponent);
    Phasors tones;
    for (const double stiffness : stiffnesses)
      tones.push_back(std::polar(total * std::pow(stiffness, exponent) / sum,
                                 uniform(-std::numbers::pi, std::numbers::pi)));
    return tones;
  }

  std::mt19937_64 engine_;
};

}  // namespace combforce::test

// The motion itself, sample by sample, against SUNDIALS CVODE from the same initial state.
#include "tests/unit/drivers/simulated_cvode.hpp"

#include "tests/unit/drivers/simulated_paper.hpp"

namespace combforce::test {

struct Comparison {
  std::string model;
  std::vector<double> parameters;
  std::vector<std::uint64_t> bins;
  DriveScheme scheme;
};

// Greatest distance of any mode's deflection over `milliseconds` after contact, pm.
double greatest_distance_pm(const Comparison& what, IntegratorAccuracy accuracy, int milliseconds) {
  const OscillatorSettings settings = paper_oscillator(what.bins, what.scheme, 8e6, accuracy);
  const std::vector<double>& p = what.parameters;
  CvodeMotion oracle(settings, [&](double d, double velocity) {
    if (what.model == "kelvin_voigt") return viscous_hertz(p[0], p[1], p[2], d, velocity);
    if (what.model == "lennard_jones") return lennard_jones(p[0], p[1], p[2], d);
    return what.model == "hertz" ? paper_hertz(p[0], p[1], d) : paper_dmt(p[0], p[1], p[2], p[3], d);
  });
  Oscillator oscillator(settings);
  oscillator.engage(find_model(what.model), what.parameters);
  double greatest = 0.0;
  std::vector<double> volts(1);
  for (int n = 0; n < 8000 * milliseconds; ++n) {
    oracle.advance_to(n / settings.sample_rate_hz);
    for (std::size_t m = 0; m < settings.cantilever.modes.size(); ++m) {
      const double distance = std::abs(oracle.mode_nm(m) - oscillator.mode_nm(m));
      if (!(distance <= greatest)) greatest = distance;  // NaN too
    }
    oscillator.advance(volts);
  }
  return greatest / pm;
}

const Comparison hertz_case{"hertz", {-40.0, 1.0}, {234, 1348}, DriveScheme::equal_amplitude};
const Comparison dmt_case{"dmt", {-40.0, 1.0, 5.0, 0.5}, {234, 1348, 3516, 6470}, DriveScheme::equal_energy};
// Beyond the paper: stiffer, lower, stickier, with response in undriven modes.
const Comparison hard_case{"dmt", {-30.0, 10.0, 10.0, 0.3}, {234, 1348}, DriveScheme::equal_energy};

const Comparison viscous_case{
    "kelvin_voigt", {-40.0, 1.0, 0.1}, {234, 1348, 3516, 6470}, DriveScheme::equal_energy};

const Comparison wall_case{"lennard_jones", {-49.0, 0.3, 0.4}, {234, 1348}, DriveScheme::equal_energy};
const Comparison many_tones_wall_case{
    "lennard_jones", {-49.0, 0.3, 0.4}, {234, 1348, 3516, 6470}, DriveScheme::equal_energy};

// Deflections, not tones, at the start of contact, where steps of 30 nm ring: the bound is the one on tones.
TEST(SimulatedCvode, AccurateMotionFollowsCvode) {
  EXPECT_LT(greatest_distance_pm(hertz_case, IntegratorAccuracy::accurate, 1), 0.05);
  EXPECT_LT(greatest_distance_pm(dmt_case, IntegratorAccuracy::accurate, 1), 0.05);
}

TEST(SimulatedCvode, LiveMotionFollowsCvode) {
  EXPECT_LT(greatest_distance_pm(hertz_case, IntegratorAccuracy::live, 1), 5.0);
  EXPECT_LT(greatest_distance_pm(dmt_case, IntegratorAccuracy::live, 1), 5.0);
}

// The cells end at p0, not where the force lets go behind the tip: that kink costs some accuracy.
TEST(SimulatedCvode, ViscousContactFollowsCvode) {
  EXPECT_LT(greatest_distance_pm(viscous_case, IntegratorAccuracy::accurate, 1), 0.2);
}

// Differences grow more here; CVODE itself is good to 0.02 pm.
TEST(SimulatedCvode, StiffStickyContactFollowsCvode) {
  EXPECT_LT(greatest_distance_pm(hard_case, IntegratorAccuracy::accurate, 1), 0.1);
}

// The wall turns the tip within 0.1 nm; in the shortest cell of the ladder it would move by 0.5 or 1 nm. Four
// times the bounds of soft contacts: a steep force makes more of a difference.
TEST(SimulatedCvode, TipTurnedByAHardWallFollowsCvode) {
  EXPECT_LT(greatest_distance_pm(wall_case, IntegratorAccuracy::accurate, 1), 0.2);
  EXPECT_LT(greatest_distance_pm(wall_case, IntegratorAccuracy::live, 1), 20.0);
  EXPECT_LT(greatest_distance_pm(many_tones_wall_case, IntegratorAccuracy::live, 1), 20.0);
}

}  // namespace combforce::test

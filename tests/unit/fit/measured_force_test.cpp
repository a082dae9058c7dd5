// What follows from the measured forces without a model: virial, dissipated power, whether there is contact.
#include <gtest/gtest.h>

#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <numbers>

#include "tests/unit/fit/random_pixel.hpp"

namespace combforce::test {
namespace {

FitResult fit(const FitConditions& conditions, const Phasors& tip_nm) {
  PixelFitter fitter(conditions);
  FitResult result;
  fitter.fit(tip_nm, result);
  return result;
}

// Averages of F d and of -F d' over one window, of the tones' sums of cosines in time.
TEST(MeasuredForce, VirialAndPowerAreTimeAverages) {
  FitConditions conditions = paper_conditions("hertz", {3, 7, 11}, {});
  conditions.sample_rate_hz = 64e3;  // Delta f = 1 kHz
  conditions.comb.window_samples = 64;
  const Phasors tip_nm{{12.0, -5.0}, {2.0, 3.0}, {-1.0, 0.5}};
  const Phasors forces{{0.4, 0.2}, {-0.3, 1.0}, {0.0, -0.7}};
  conditions.free_response->mean_nm = tip_nm;
  for (std::size_t i = 0; i < 3; ++i)
    conditions.free_response->mean_nm[i] -=
        forces[i] *
        tip_response(conditions.cantilever, 1e3 * static_cast<double>(conditions.comb.tones[i].bin));
  double virial = 0.0, power = 0.0;
  for (int n = 0; n < 64; ++n) {
    const double t = n / 64e3;
    double force = 0.0, d = 0.0, velocity = 0.0;
    for (std::size_t i = 0; i < 3; ++i) {
      const double w = 2e3 * std::numbers::pi * static_cast<double>(conditions.comb.tones[i].bin);
      const std::complex<double> turn = std::polar(1.0, w * t);
      force += (forces[i] * turn).real();
      d += (tip_nm[i] * turn).real();
      velocity += (std::complex(0.0, w) * tip_nm[i] * turn).real();
    }
    virial += force * d / 64.0;
    power -= force * velocity / 64.0;
  }
  const FitResult result = fit(conditions, tip_nm);
  EXPECT_NEAR(result.virial_nn_nm, virial, 1e-9 * std::abs(virial));
  EXPECT_NEAR(result.dissipated_fw, 1e-3 * power, 1e-12 * std::abs(power));  // nN nm/s = 1e-3 fW
}

// A conservative force along the motion of all its tones takes no power.
TEST(MeasuredForce, AConservativeForceTakesNoPowerFromASingleTone) {
  const ModelPixel pixel = pixel_of<Dmt>({234}, {{0.0, -45.0}}, {-40.0, 3.0, 5.0, 0.5});
  const FitResult result = fit(pixel.conditions, pixel.tip_nm);
  const double drive_fw = 0.5e-3 * 2.0 * std::numbers::pi * 117e3 * 45.0 * 45.0 * 4.0 / 212.0;
  EXPECT_LT(std::abs(result.dissipated_fw), 1e-9 * drive_fw);
  EXPECT_LT(result.virial_nn_nm, 0.0) << "repulsion at negative d";
}

// Sum |F|^2/s^2 at `share` of the quantile of chi^2 that a normal deviate exceeds at 5 sigma, all of it in
// one tone.
FitStatus status_at(const FitConditions& conditions, double share, std::size_t tone) {
  const std::size_t tones = conditions.comb.tones.size();
  const double rare = boost::math::cdf(boost::math::complement(boost::math::normal(), 5.0));
  const double threshold = boost::math::quantile(
      boost::math::complement(boost::math::chi_squared(2.0 * static_cast<double>(tones)), rare));
  const double frequency_hz = static_cast<double>(conditions.comb.tones[tone].bin) * paper_delta_f_hz;
  const double free_share =
      static_cast<double>(conditions.windows) / static_cast<double>(conditions.free_response->windows);
  const double variance = force_quadrature_variance(conditions.cantilever, *conditions.noise, tone,
                                                    frequency_hz, paper_delta_f_hz, conditions.windows) *
                          (1.0 + free_share);
  Phasors forces(tones);
  forces[tone] = std::polar(std::sqrt(share * threshold * variance), 0.3);
  Phasors tip_nm = conditions.free_response->mean_nm;
  tip_nm[tone] += tip_response(conditions.cantilever, frequency_hz) * forces[tone];
  return fit(conditions, tip_nm).status;
}

TEST(NoContact, TheThresholdIsFiveSigmaOfEngagedAndFreeNoise) {
  FitConditions conditions = paper_conditions("dmt", {234, 1348, 3516, 6470},
                                              {{0.0, -36.1}, {0.0, -8.15}, {0.0, -3.77}, {0.0, -1.98}});
  // Hot enough that the 1e-6 of the drive forces, for what noise leaves out, is negligible.
  conditions.noise->temperature_k = 3e4;
  for (const std::uint64_t free_windows : {1U, 100U})
    for (std::size_t tone = 0; tone < 4; ++tone) {
      conditions.free_response->windows = free_windows;
      EXPECT_EQ(status_at(conditions, 0.999, tone), FitStatus::no_contact) << "tone " << tone;
      EXPECT_NE(status_at(conditions, 1.001, tone), FitStatus::no_contact) << "tone " << tone;
    }
}

// Without a noise model a force below a millionth of the drive's is none.
TEST(NoContact, WithoutNoiseAMillionthOfTheDriveIsNoContact) {
  FitConditions conditions = paper_conditions("hertz", {234, 1348}, {{0.0, -40.8}, {0.0, -9.2}});
  conditions.noise.reset();
  double drive = 0.0;
  for (std::size_t i = 0; i < 2; ++i)
    drive += std::norm(conditions.free_response->mean_nm[i] /
                       tip_response(conditions.cantilever, i == 0 ? 117e3 : 674e3));
  for (const auto& [share, contact] : {std::pair(1e-6, false), std::pair(1e-4, true)}) {
    Phasors tip_nm = conditions.free_response->mean_nm;
    tip_nm[0] += share * std::sqrt(drive) * tip_response(conditions.cantilever, 117e3);
    EXPECT_EQ(fit(conditions, tip_nm).status != FitStatus::no_contact, contact) << share;
  }
}

// Many tones about one mode, as an intermodulation comb has them.
TEST(ManyTones, SixtyFourTonesGiveTheTruth) {
  RandomPixels draw(51);
  const ModelPixel hertz = draw.intermodulation<Hertz>(64), dmt = draw.intermodulation<Dmt>(64);
  for (const ModelPixel* pixel : {&hertz, &dmt}) {
    const FitResult result = fit(pixel->conditions, pixel->tip_nm);
    EXPECT_EQ(result.status, FitStatus::converged) << pixel->conditions.settings.model;
    for (std::size_t k = 0; k < pixel->truth.size(); ++k)
      EXPECT_NEAR(result.parameters[k], pixel->truth[k], k == 0 ? 1e-4 : 5e-5 * pixel->truth[k]) << "p" << k;
  }
}

}  // namespace
}  // namespace combforce::test

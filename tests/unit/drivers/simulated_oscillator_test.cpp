// The oscillator without a surface: exact motion, exact thermal statistics, continuity of the drive.
#include "drivers/simulated/oscillator.hpp"

#include <numbers>

#include "fit/units.hpp"
#include "tests/unit/drivers/simulated_paper.hpp"

namespace combforce::test {

constexpr double two_pi = 2.0 * std::numbers::pi;
const std::vector<std::uint64_t> paper_bins{234, 1348, 3516, 6470};

// One mode at 1 MS/s without drive, in windows of 2 ms.
OscillatorSettings thermal_mode(std::uint64_t seed, double temperature_k) {
  OscillatorSettings settings;
  settings.sample_rate_hz = 1e6;
  settings.cantilever.modes = {{117e3, 212.0, 4.0, 1.0}};
  settings.window_samples = 2000;
  settings.temperature_k = temperature_k;
  settings.seed = seed;
  return settings;
}

TEST(Oscillator, FreeMotionIsTheSumOfItsTones) {
  OscillatorSettings settings =
      paper_oscillator(paper_bins, DriveScheme::equal_amplitude, 8e6, IntegratorAccuracy::live);
  for (std::size_t m = 0; m < 4; ++m)
    settings.cantilever.modes[m].sensitivity_nm_per_v = 10.0 + static_cast<double>(m);
  Oscillator oscillator(settings);
  std::vector<double> volts(100000);
  oscillator.advance(volts);
  for (std::size_t n = 0; n < volts.size(); n += 997) {
    double expected = 0.0;
    for (std::size_t i = 0; i < paper_bins.size(); ++i) {
      const double frequency = 500.0 * static_cast<double>(paper_bins[i]);
      const double phase = two_pi * std::fmod(frequency * static_cast<double>(n) / 8e6, 1.0);
      expected += (detector_response(settings.cantilever, frequency) * settings.drive_forces_nn[i] *
                   std::polar(1.0, phase))
                      .real();
    }
    // Volts of 5: phases are renewed every window, so rounding stays near 1e-16 times the 16000 steps
    // between.
    ASSERT_NEAR(volts[n], expected, 1e-10) << "sample " << n;
  }
}

// After the drive stops, every mode goes on from its deflection and velocity and rings down on its own.
TEST(Oscillator, DriveStepsAreContinuous) {
  const OscillatorSettings settings =
      paper_oscillator(paper_bins, DriveScheme::equal_energy, 8e6, IntegratorAccuracy::live);
  Oscillator oscillator(settings);
  std::vector<double> volts(12345);
  oscillator.advance(volts);
  const double t0 = 12345 / 8e6;
  oscillator.set_drive(std::vector<std::complex<double>>(4));
  std::vector<double> after(4000);
  oscillator.advance(after);
  for (std::size_t n = 0; n < after.size(); ++n) {
    const double t = static_cast<double>(n) / 8e6;
    double expected = 0.0;
    for (const Mode& mode : settings.cantilever.modes) {
      double q = 0.0, v = 0.0;
      for (std::size_t i = 0; i < paper_bins.size(); ++i) {
        const double frequency = 500.0 * static_cast<double>(paper_bins[i]);
        const std::complex<double> tone = mode_response(mode, frequency) * settings.drive_forces_nn[i] *
                                          std::polar(1.0, two_pi * frequency * t0);
        q += tone.real();
        v += (std::complex<double>(0.0, two_pi * frequency) * tone).real();
      }
      const double w = two_pi * mode.frequency_hz, decay = w / (2.0 * mode.quality_factor);
      const double ringing = std::sqrt(w * w - decay * decay);
      expected += std::exp(-decay * t) *
                  (q * std::cos(ringing * t) + (v + decay * q) / ringing * std::sin(ringing * t));
    }
    ASSERT_NEAR(after[n], expected, 1e-8) << "sample " << n;
  }
}

// A drive 700 ppm fast, then 300 ppm slow, then on the comb again: the phase goes on from where it was, and
// once the mode has settled (40 ring-downs of 577 samples) it moves as at that frequency.
TEST(Oscillator, DetunedDriveTurnsAgainstTheComb) {
  OscillatorSettings settings = thermal_mode(1, 0.0);
  settings.drive_bins = {234};
  settings.drive_forces_nn = {{0.6, -0.3}};
  Oscillator oscillator(settings);
  double turns = 0.0;
  for (const double detuning : {0.0, 7e-4, -3e-4, 0.0}) {
    oscillator.detune(detuning);
    const double frequency = 117e3 * (1.0 + detuning);
    std::vector<double> volts(30000 + 123);
    oscillator.advance(volts);
    for (std::size_t n = 25000; n < volts.size(); n += 97) {
      const double phase = two_pi * std::fmod(turns + frequency * static_cast<double>(n) / 1e6, 1.0);
      const double expected = (detector_response(settings.cantilever, frequency) *
                               settings.drive_forces_nn[0] * std::polar(1.0, phase))
                                  .real();
      // exp(-43) of the 30 nm ring on; a phase of 20000 turns is rounded to 1e-11.
      ASSERT_NEAR(volts[n], expected, 1e-8) << "sample " << n << " at " << detuning;
    }
    turns += frequency * static_cast<double>(volts.size()) / 1e6;
  }
}

TEST(Oscillator, SameSeedSameSamplesHoweverTheyAreAskedFor) {
  OscillatorSettings settings =
      paper_oscillator(paper_bins, DriveScheme::equal_energy, 8e6, IntegratorAccuracy::live);
  settings.temperature_k = 300.0;
  Oscillator at_once(settings), in_parts(settings);
  settings.seed = 2;
  Oscillator other(settings);
  const std::vector<double> parameters{-40.0, 1.0, 5.0, 0.5};
  for (Oscillator* oscillator : {&at_once, &in_parts, &other})
    oscillator->engage(find_model("dmt"), parameters);
  std::vector<double> whole(20000), parts(20000), different(20000);
  at_once.advance(whole);
  other.advance(different);
  for (std::size_t n = 0, length = 1; n < parts.size(); n += length, length = length % 700 + 3) {
    in_parts.advance(std::span(parts).subspan(n, std::min(length, parts.size() - n)));
  }
  EXPECT_EQ(whole, parts);
  EXPECT_NE(whole, different);
}

// Variance of q and of q' (by the exact propagator: q' follows from two samples) is kB T/k and w^2 kB T/k.
// Over a time T the mean of q^2 scatters by sqrt(tau/T), 0.54 % here; 5 of them.
TEST(Oscillator, ThermalMotionHasEquipartition) {
  const OscillatorSettings settings = thermal_mode(11, 300.0);
  const Mode& mode = settings.cantilever.modes[0];
  Oscillator oscillator(settings);
  std::vector<double> q(20000000);
  oscillator.advance(q);
  double square = 0.0, product = 0.0;
  for (std::size_t n = 0; n + 3 < q.size(); ++n) {
    square += q[n] * q[n];
    product += q[n] * q[n + 3];
  }
  const double mean = square / static_cast<double>(q.size());
  const double expected = boltzmann_nn_nm_per_k * 300.0 / mode.stiffness_n_per_m;
  EXPECT_NEAR(mean / expected, 1.0, 0.027);
  // Covariance over 3 us, exp(-g t)(cos W t + (g/W) sin W t): independent of the scatter of the energy.
  const double w = two_pi * mode.frequency_hz, decay = w / (2.0 * mode.quality_factor), t = 3e-6;
  const double ringing = std::sqrt(w * w - decay * decay);
  EXPECT_NEAR(product / square,
              std::exp(-decay * t) * (std::cos(ringing * t) + decay / ringing * std::sin(ringing * t)), 1e-3);
}

// Successive windows of a free mode: variance of a quadrature (kB T/k)(2 tau/T)[1 - (tau/T)(1 -
// e^(-T/tau))], 20.7 pm squared, and correlation (tau/T)(1 - e^(-T/tau))^2 / (2 [...]), 0.19. Over 2 * 10^4
// quadratures both scatter by about 1 %; 5 of them.
TEST(Oscillator, WindowedThermalNoiseHasItsCovariance) {
  const OscillatorSettings settings = thermal_mode(12, 300.0);
  const Mode& mode = settings.cantilever.modes[0];
  Oscillator oscillator(settings);
  constexpr int windows = 10000, bin = 234;
  std::vector<double> q(settings.window_samples);
  std::vector<std::complex<double>> phasors;
  for (int i = 0; i < windows; ++i) {
    oscillator.advance(q);
    std::complex<double> sum;
    for (std::size_t n = 0; n < q.size(); ++n)
      sum += q[n] * std::polar(1.0, -two_pi * static_cast<double>(bin * n % 2000) / 2000.0);
    phasors.push_back(sum * 2.0 / 2000.0);
  }
  double power = 0.0, lagged = 0.0;
  for (int i = 0; i + 1 < windows; ++i) {
    power += std::norm(phasors[i]) / 2.0 / (windows - 1);
    lagged += (phasors[i] * std::conj(phasors[i + 1])).real() / 2.0 / (windows - 1);
  }
  const double relative = ring_down_s(mode) / 2e-3;
  const double kept = 1.0 - std::exp(-1.0 / relative);
  const double variance =
      boltzmann_nn_nm_per_k * 300.0 / mode.stiffness_n_per_m * 2.0 * relative * (1.0 - relative * kept);
  EXPECT_NEAR(std::sqrt(variance), 0.0207, 0.0001);
  EXPECT_NEAR(power / variance, 1.0, 0.05);
  EXPECT_NEAR(lagged / power, relative * kept * kept / (2.0 * (1.0 - relative * kept)), 0.05);
}

// Every mode of a multimodal cantilever has its own kB T/k, whatever its neighbours. The slowest, of tau =
// 0.58 ms, decides: 1 s scatters by 2.4 %.
TEST(Oscillator, EveryModeHasItsOwnEquipartition) {
  OscillatorSettings settings =
      paper_oscillator(paper_bins, DriveScheme::equal_energy, 8e6, IntegratorAccuracy::live);
  settings.drive_forces_nn.assign(4, 0.0);
  settings.temperature_k = 300.0;
  Oscillator oscillator(settings);
  std::vector<double> squares(4, 0.0), volts(37);
  constexpr int samples = 8000000 / 37;
  for (int i = 0; i < samples; ++i) {
    oscillator.advance(volts);
    for (std::size_t m = 0; m < 4; ++m) squares[m] += oscillator.mode_nm(m) * oscillator.mode_nm(m) / samples;
  }
  for (std::size_t m = 0; m < 4; ++m) {
    const Mode& mode = settings.cantilever.modes[m];
    const double bound = 5.0 * std::sqrt(ring_down_s(mode) / 1.0);
    EXPECT_NEAR(squares[m] * mode.stiffness_n_per_m / (boltzmann_nn_nm_per_k * 300.0), 1.0, bound)
        << "mode " << m;
  }
}

}  // namespace combforce::test

// All five cases in full, 20 ms simulated by CVODE and by the simulator: the tones of every mode agree.
#include "tests/unit/drivers/simulated_cvode.hpp"
#include "tests/unit/drivers/simulated_paper.hpp"

namespace combforce::test {

// Peak phasors of every mode at the bins over the last 2 ms of 20, [mode][bin].
std::vector<std::vector<std::complex<double>>> cvode_tones(const PaperCase& paper,
                                                           const OscillatorSettings& settings) {
  const std::vector<double>& p = paper.truth;
  CvodeMotion oracle(settings, [&](double d, double /*nm_per_s*/) {
    return paper.model == "hertz" ? paper_hertz(p[0], p[1], d) : paper_dmt(p[0], p[1], p[2], p[3], d);
  });
  const std::uint64_t window = settings.window_samples;
  std::vector<std::vector<std::complex<double>>> tones(settings.cantilever.modes.size(),
                                                       std::vector<std::complex<double>>(paper.bins.size()));
  for (std::uint64_t n = 9 * window; n < 10 * window; ++n) {
    oracle.advance_to(static_cast<double>(n) / settings.sample_rate_hz);
    for (std::size_t b = 0; b < paper.bins.size(); ++b) {
      const double phase = 2.0 * std::numbers::pi * static_cast<double>(paper.bins[b] * n % window) /
                           static_cast<double>(window);
      for (std::size_t m = 0; m < tones.size(); ++m) {
        tones[m][b] += 2.0 / static_cast<double>(window) * oracle.mode_nm(m) * std::polar(1.0, -phase);
      }
    }
  }
  return tones;
}

TEST(SimulatedCvodeSlow, TonesOfEveryModeAgreeInTheFiveCases) {
  const std::vector<PaperCase> cases = paper_cases();
  if (cases.empty()) GTEST_SKIP() << "cases/paper_cases.json is not in " << COMBFORCE_SHARED_DIR;
  for (const PaperCase& paper : cases) {
    const SteadyStateSettings settings = paper.steady_state(25e6, IntegratorAccuracy::accurate);
    const SteadyState ours = simulate_steady_state(settings);
    const auto theirs = cvode_tones(paper, settings.oscillator);
    for (std::size_t m = 0; m < theirs.size(); ++m) {
      for (std::size_t b = 0; b < paper.bins.size(); ++b) {
        EXPECT_LT(std::abs(ours.mode_nm[m][b] - theirs[m][b]), 0.05 * pm)
            << paper.name << ", mode " << m << ", tone " << b;
      }
    }
  }
}

}  // namespace combforce::test

// Fits a second on one core, against the paper's way of evaluating a residual in the same run: 400k samples
// of d(t), the force at each, FFTW's real transform, the tones' bins. The paper's fit needs tens of such
// residuals (its Jacobian takes one a parameter besides), so `paper_residuals` (time of a fit over time of
// one residual) says how many of them a whole fit costs; the ratio carries over to another machine better
// than the rate.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <vector>

#include "dsp/fftw.hpp"
#include "tests/unit/fit/random_pixel.hpp"

namespace combforce::test {
namespace {

template <typename Action>
double fastest_seconds(int times, const Action& action) {
  double fastest = std::numeric_limits<double>::infinity();
  for (int i = 0; i < times; ++i) {
    const auto start = std::chrono::steady_clock::now();
    action();
    fastest =
        std::min(fastest, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  return fastest;
}

// One residual of the DMT model at the paper's four tones: inverse transform for the motion, force,
// transform.
class PaperResidual {
 public:
  PaperResidual() : d_(samples), phasors_(samples / 2 + 1) {
    auto* const spectrum = reinterpret_cast<fftw_complex*>(phasors_.data());
    plan_.reset(fftw_plan_dft_r2c_1d(samples, force_.get(), spectrum, FFTW_ESTIMATE));
    const std::vector<std::pair<int, double>> tones{{234, 36.0}, {1348, 8.1}, {3516, 3.8}, {6470, 2.0}};
    for (std::size_t n = 0; n < samples; ++n)
      for (const auto& [bin, amplitude] : tones)
        d_[n] += amplitude * std::sin(2.0 * std::numbers::pi * bin * static_cast<double>(n) / samples);
  }

  void run() {
    const std::array<double, 4> p{-40.0, 1.0, 5.0, 0.5};
    for (std::size_t n = 0; n < samples; ++n) force_.get()[n] = Dmt::force(p.data(), d_[n]);
    fftw_execute(plan_.get());
    benchmark::DoNotOptimize(phasors_.data());
  }

 private:
  static constexpr int samples = 400'000;
  std::vector<double> d_;
  FftwReals force_{fftw_alloc_real(samples)};
  std::vector<std::complex<double>> phasors_;
  FftwPlan plan_;
};

double paper_residual_seconds() {
  static const double seconds = [] {
    PaperResidual residual;
    return fastest_seconds(20, [&] { residual.run(); });
  }();
  return seconds;
}

void paper_residual(benchmark::State& state) {
  PaperResidual residual;
  for ([[maybe_unused]] auto iteration : state) residual.run();
}
BENCHMARK(paper_residual)->Unit(benchmark::kMillisecond);

void fit(benchmark::State& state, const ModelPixel& pixel) {
  PixelFitter fitter(pixel.conditions);
  FitResult result;
  const auto once = [&] {
    fitter.fit(pixel.tip_nm, result);
    benchmark::DoNotOptimize(result);
  };
  for ([[maybe_unused]] auto iteration : state) once();
  const double seconds = fastest_seconds(10, once);
  state.SetItemsProcessed(state.iterations());
  state.counters["best_fits/s"] = 1.0 / seconds;
  state.counters["paper_residuals"] = seconds / paper_residual_seconds();
  state.counters["status"] = static_cast<double>(result.status);
}

// Engaged tones of the paper's cases to 10 pm, with forces that a model explains.
const std::vector<std::uint64_t> two{234, 1348}, four{234, 1348, 3516, 6470};

BENCHMARK_CAPTURE(fit, hertz_2_tones, pixel_of<Hertz>(two, {{17.05, -31.58}, {1.95, -8.78}}, {-40.0, 1.0}))
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(fit, hertz_4_tones,
                  pixel_of<Hertz>(four, {{8.0, -34.9}, {1.2, -8.0}, {0.45, -3.74}, {0.07, -1.97}},
                                  {-40.0, 1.0}))
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(fit, dmt_4_tones_equal_energy,
                  pixel_of<Dmt>(four, {{3.78, -35.82}, {0.57, -8.11}, {0.22, -3.76}, {0.04, -1.98}},
                                {-40.0, 1.0, 5.0, 0.5}))
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(fit, dmt_4_tones_equal_amplitude,
                  pixel_of<Dmt>(four, {{1.0, -12.48}, {0.3, -12.48}, {0.2, -12.49}, {0.1, -12.5}},
                                {-40.0, 1.0, 5.0, 0.5}))
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(fit, hertz_12_tones_of_one_mode, RandomPixels(51).intermodulation<Hertz>(12))
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(fit, dmt_12_tones_of_one_mode, RandomPixels(51).intermodulation<Dmt>(12))
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(fit, dmt_64_tones_of_one_mode, RandomPixels(51).intermodulation<Dmt>(64))
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace combforce::test

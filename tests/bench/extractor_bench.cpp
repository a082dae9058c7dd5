// Comb extraction of one window of 400k codes against FFTW's real transform of the same codes, in the same
// run: the ratio carries over to another machine better than the rate.
//
// Roofline, with two 512-bit units. Of every vector of 16 codes the fold takes 4.5 instructions on these
// units (widen, add or subtract, convert, sum, extremes), once for all tones. A tone takes 1.3: one
// multiply-add (the fold halves the two of a complex product) and its share of adding runs and of carrying
// sums to double. Two a cycle: 16 samples take (4.5 + 1.3 T)/2 cycles, 3.3 samples a cycle with 4 tones
// and 1.25 with 16. The codes are read once, from L2, and the inner loop's working set (8 KiB folded, 256 B a
// tone) stays in L1: arithmetic is the bound, not memory. The cost is linear in T where the FFT's is
// constant, hence a crossover near 100 tones.
#include <benchmark/benchmark.h>
#include <fftw3.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <memory>
#include <random>
#include <type_traits>
#include <vector>

#include "dsp/comb_extractor.hpp"

namespace combforce {
namespace {

constexpr std::size_t window_samples = 400'000;

std::vector<std::int16_t> codes(std::size_t count) {
  std::mt19937 random(1);
  std::uniform_int_distribution<int> code(-30000, 30000);
  std::vector<std::int16_t> samples(count);
  for (std::int16_t& sample : samples) sample = static_cast<std::int16_t>(code(random));
  return samples;
}

Comb comb_of(std::size_t tones) {
  Comb comb{window_samples, {}};
  for (std::size_t t = 0; t < tones; ++t) comb.tones.push_back({234 + 557 * t, true});
  return comb;
}

// Single-precision real transform with a measured plan, conversion from codes included.
class Transform {
 public:
  explicit Transform(const std::vector<std::int16_t>& samples) : samples_(samples) {}

  void run() {
    for (std::size_t i = 0; i < window_samples; ++i) in_.get()[i] = samples_[i];
    fftwf_execute(plan_.get());
    benchmark::DoNotOptimize(out_.get()[234][0]);
  }

 private:
  struct Free {
    void operator()(void* memory) const { fftwf_free(memory); }
    void operator()(fftwf_plan plan) const { fftwf_destroy_plan(plan); }
  };
  const std::vector<std::int16_t>& samples_;
  std::unique_ptr<float, Free> in_{fftwf_alloc_real(window_samples)};
  std::unique_ptr<fftwf_complex, Free> out_{fftwf_alloc_complex(window_samples / 2 + 1)};
  std::unique_ptr<std::remove_pointer_t<fftwf_plan>, Free> plan_{
      fftwf_plan_dft_r2c_1d(window_samples, in_.get(), out_.get(), FFTW_MEASURE)};
};

// The fastest of many: what another program takes from the core is not ours.
template <typename Action>
double fastest_seconds(const Action& action) {
  double fastest = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 50; ++i) {
    const auto start = std::chrono::steady_clock::now();
    action();
    fastest =
        std::min(fastest, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  return fastest;
}

double fftw_seconds() {
  static const double seconds = [] {
    const std::vector<std::int16_t> samples = codes(window_samples);
    Transform transform(samples);
    return fastest_seconds([&] { transform.run(); });
  }();
  return seconds;
}

void report(benchmark::State& state, double seconds) {
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(window_samples));
  state.counters["best_GS/s"] = 1e-9 * static_cast<double>(window_samples) / seconds;
  state.counters["times_fftw"] = fftw_seconds() / seconds;
}

void fftw(benchmark::State& state) {
  const std::vector<std::int16_t> samples = codes(window_samples);
  Transform transform(samples);
  for ([[maybe_unused]] auto iteration : state) transform.run();
  report(state, fftw_seconds());
}
BENCHMARK(fftw);

// Arguments: tones, interleaved channels.
void comb(benchmark::State& state) {
  const auto channels = static_cast<std::uint16_t>(state.range(1));
  const std::vector<std::int16_t> samples = codes(window_samples * channels);
  CombExtractor extractor(comb_of(static_cast<std::size_t>(state.range(0))), channels, SampleFormat::i16,
                          -32768, 32767);
  std::vector<std::complex<double>> phasors(extractor.comb().tones.size());
  std::vector<double> means(channels);
  const auto extract = [&] {
    extractor.begin(0, 1);
    extractor.add(samples.data(), window_samples);
    extractor.finish(phasors, means);
    benchmark::DoNotOptimize(phasors.data());
  };
  for ([[maybe_unused]] auto iteration : state) extract();
  report(state, fastest_seconds(extract));
}
BENCHMARK(comb)
    ->ArgNames({"tones", "channels"})
    ->Args({1, 1})
    ->Args({4, 1})
    ->Args({16, 1})
    ->Args({32, 1})
    ->Args({64, 1})
    ->Args({4, 2})
    ->Args({4, 4});

}  // namespace
}  // namespace combforce

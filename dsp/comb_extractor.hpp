// The lock-in: peak phasors of every tone of a comb over a span of samples.
//
// For an analysed span of W windows of N samples that starts at stream sample s,
//     D_b = 2/(W N) * sum_{n=s}^{s+WN-1} x[n] exp(-i 2 pi phase_index(b, n, N)/N),
// the peak phasor of d(t) = Re sum D_b exp(+i w_b t), t = 0 at stream sample 0. Inner products run in single
// precision over chunks of `chunk_samples`, aligned to the start of the span, and accumulate in double with
// an exact integer phase per chunk; the result is within 1e-6 of full scale of a long-double DFT. Chunks are
// aligned to the span and not to the blocks that arrive, so the same samples give the same bits however
// they are cut into blocks.
//
// Thread-bound. begin(), add() and finish() do not allocate, lock, wait or call the system.
#pragma once

#include <complex>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "dsp/comb.hpp"
#include "dsp/sample_block.hpp"

namespace combforce {

class CombExtractor {
 public:
  // The comb is validated (std::invalid_argument). `channels` >= 1 interleaved channels arrive; tones are
  // extracted from channel 0, means from all. `clip_lo`, `clip_hi`: codes of channel 0 at or beyond these
  // count as clipped (pass -inf, +inf for none).
  CombExtractor(Comb comb, std::uint16_t channels, SampleFormat format, double clip_lo, double clip_hi);
  ~CombExtractor();
  CombExtractor(CombExtractor&&) noexcept;
  CombExtractor& operator=(CombExtractor&&) noexcept;

  // Starts a span of `windows` windows at stream sample `first_sample`, discarding any unfinished one.
  void begin(std::uint64_t first_sample, std::uint32_t windows);

  // Adds the next `frames` interleaved frames of the span (`samples` points at channel 0 of the first).
  // Frames beyond the end of the span are ignored; returns how many were taken. i16 or f32 as constructed.
  std::size_t add(const std::int16_t* samples, std::size_t frames);
  std::size_t add(const float* samples, std::size_t frames);

  // Frames still missing from the span.
  std::uint64_t missing() const;

  // Writes the phasors in codes (one a tone) and the mean code of every channel. missing() must be 0.
  void finish(std::span<std::complex<double>> phasors, std::span<double> channel_means);

  // Clipped samples of channel 0 in the span so far.
  std::uint64_t clipped() const;

  const Comb& comb() const;

 private:
  class State;
  std::unique_ptr<State> state_;
};

}  // namespace combforce

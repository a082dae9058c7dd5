// The lock-in: peak phasors of every tone of a comb over a span of samples.
//
// For an analysed span of W windows of N samples that starts at stream sample s,
//     D_b = 2/(W N) * sum_{n=s}^{s+WN-1} x[n] exp(-i 2 pi phase_index(b, n, N)/N),
// the peak phasor of d(t) = Re sum D_b exp(+i w_b t), t = 0 at stream sample 0. Chunks of a thousand samples
// or so are summed in single precision and chained in double; the phase of the last one is exact, in
// integers. The result is within 1e-6 of full scale (32768 codes for i16, max |x| for f32) of the exact sum,
// whatever the samples, the bin, the window length or the start; comb_kernels.hpp derives the bound.
// (Chaining adds 1e-16 a chunk: nothing below 10^12 samples a span.) Chunks are aligned to the span and not
// to the blocks that arrive, so the same samples give the same bits however they are cut into blocks. A CPU
// with other vector instructions may differ in the last bits.
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

  // Starts a span of `windows` >= 1 windows at stream sample `first_sample`, discarding any unfinished one.
  void begin(std::uint64_t first_sample, std::uint32_t windows);

  // Adds the next `frames` interleaved frames of the span (`samples` points at channel 0 of the first).
  // Frames beyond the end of the span are ignored; returns how many were taken. i16 or f32 as constructed,
  // the other one throws std::logic_error. Samples that are not finite make the phasors so.
  std::size_t add(const std::int16_t* samples, std::size_t frames);
  std::size_t add(const float* samples, std::size_t frames);

  // Frames still missing from the span.
  std::uint64_t missing() const;

  // Writes the phasors in codes (one a tone) and the mean code of every channel. missing() must be 0 and the
  // sizes must fit, else std::logic_error.
  void finish(std::span<std::complex<double>> phasors, std::span<double> channel_means) const;

  // Clipped samples of channel 0 in the span so far.
  std::uint64_t clipped() const;

  const Comb& comb() const;

 private:
  class State;
  std::unique_ptr<State> state_;
};

}  // namespace combforce

#include "dsp/comb_extractor.hpp"

#include <fmt/format.h>
#include <hwy/aligned_allocator.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <type_traits>
#include <utility>
#include <vector>

#include "dsp/comb_kernels.hpp"

namespace combforce {

namespace {

constexpr std::size_t group_chunks = 2;

// Phase in radians of `index` / (2N) of a turn: half samples count, as the centre of a chunk lies on one.
double half_sample_phase(std::uint64_t bin, std::uint64_t half_samples, std::uint64_t window_samples) {
  return phase_radians(bin * (half_samples % (2 * window_samples)) % (2 * window_samples),
                       2 * window_samples);
}

template <typename Sample>
std::uint64_t count_clipped(const Sample* samples, std::size_t count, double lo, double hi) {
  std::uint64_t clipped = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double x = samples[i];
    clipped += static_cast<std::uint64_t>(x <= lo || x >= hi);
  }
  return clipped;
}

}  // namespace

class CombExtractor::State {
 public:
  State(Comb comb_of, std::uint16_t channel_count, SampleFormat sample_format, double lo, double hi);

  void begin(std::uint64_t first_sample, std::uint32_t windows);
  template <typename Sample>
  std::size_t add(const Sample* samples, std::size_t frames);
  void finish(std::span<std::complex<double>> phasors, std::span<double> channel_means) const;

  std::uint64_t missing() const { return span_ - taken_; }
  std::uint64_t clipped() const;
  const Comb& comb() const { return comb_; }

 private:
  template <typename Sample>
  void stage(const Sample* samples, std::size_t frames);
  template <typename Sample>
  void fold(const Sample* chunk, std::size_t valid);
  void accumulate();
  template <typename Sample>
  std::vector<Sample>& staging() {
    if constexpr (std::is_same_v<Sample, std::int16_t>)
      return staging_i16_;
    else
      return staging_f32_;
  }

  Comb comb_;
  SampleFormat format_;
  double clip_lo_, clip_hi_;
  CombKernels kernels_;
  std::size_t chunk_;                                // samples
  hwy::AlignedFreeUniquePtr<float[]> coefficients_;  // [tones][folds][cos, -sin]
  std::vector<double> advance_;                      // [tones][re, im]
  std::vector<std::complex<double>>
      lane_phase_;  // [tones][lanes], from the lane's sample to the chunk's centre

  std::uint64_t first_sample_ = 0;
  std::uint64_t span_ = 0;         // frames
  std::uint64_t taken_ = 0;        // frames
  std::uint64_t clipped_ = 0;      // of the chunks folded
  std::uint64_t chunks_done_ = 0;  // accumulated
  std::size_t staged_ = 0;         // samples of the chunk in staging
  std::size_t folded_chunks_ = 0;  // of the group
  std::vector<std::int16_t> staging_i16_;
  std::vector<float> staging_f32_;
  hwy::AlignedFreeUniquePtr<float[]> folded_;  // [group_chunks][chunk]
  hwy::AlignedFreeUniquePtr<double[]> state_;  // [tones][re, im][lanes]
  std::vector<double> channel_sums_;
};

CombExtractor::State::State(Comb comb_of, std::uint16_t channel_count, SampleFormat sample_format, double lo,
                            double hi)
    : comb_(std::move(comb_of)),
      format_(sample_format),
      clip_lo_(lo),
      clip_hi_(hi),
      kernels_(comb_kernels()),
      chunk_(kernels_.lanes * kernels_.chunk_vectors),
      channel_sums_(channel_count) {
  validate(comb_);
  if (channel_count == 0) throw std::invalid_argument("channels: 0, at least 1 is needed");
  const std::uint64_t n = comb_.window_samples;
  const std::size_t tones = comb_.tones.size();
  const std::size_t lanes = kernels_.lanes;
  const std::size_t folds = kernels_.chunk_vectors / 2;
  coefficients_ = hwy::AllocateAligned<float>(tones * folds * 2);
  folded_ = hwy::AllocateAligned<float>(group_chunks * chunk_);
  state_ = hwy::AllocateAligned<double>(tones * 2 * lanes);
  if (format_ == SampleFormat::i16)
    staging_i16_.resize(chunk_);
  else
    staging_f32_.resize(chunk_);
  for (std::size_t t = 0; t < tones; ++t) {
    const std::uint64_t bin = comb_.tones[t].bin;
    for (std::size_t j = 0; j < folds; ++j) {
      const double phase = half_sample_phase(bin, lanes * (2 * j + 1), n);
      coefficients_[(t * folds + j) * 2] = static_cast<float>(std::cos(phase));
      coefficients_[(t * folds + j) * 2 + 1] = static_cast<float>(-std::sin(phase));
    }
    const double step = phase_radians(phase_index(bin, chunk_, n), n);
    advance_.push_back(std::cos(step));
    advance_.push_back(std::sin(step));
    for (std::size_t lane = 0; lane < lanes; ++lane)
      lane_phase_.push_back(
          std::polar(1.0, -half_sample_phase(bin, 2 * lane + (kernels_.chunk_vectors - 1) * lanes, n)));
  }
  begin(0, 1);
}

void CombExtractor::State::begin(std::uint64_t first_sample, std::uint32_t windows) {
  first_sample_ = first_sample;
  span_ = windows * comb_.window_samples;
  taken_ = clipped_ = chunks_done_ = 0;
  staged_ = folded_chunks_ = 0;
  std::fill_n(state_.get(), comb_.tones.size() * 2 * kernels_.lanes, 0.0);
  std::ranges::fill(channel_sums_, 0.0);
}

template <typename Sample>
std::size_t CombExtractor::State::add(const Sample* samples, std::size_t frames) {
  if ((format_ == SampleFormat::i16) != std::is_same_v<Sample, std::int16_t>)
    throw std::logic_error("CombExtractor::add: samples are not of the format the extractor was made for");
  const std::size_t channels = channel_sums_.size();
  const std::size_t taken = static_cast<std::size_t>(std::min<std::uint64_t>(frames, missing()));
  for (std::size_t done = 0; done < taken;) {
    const Sample* const next = samples + done * channels;
    const std::size_t count = std::min(chunk_ - staged_, taken - done);
    if (count == chunk_ && channels == 1)
      fold(next, chunk_);
    else
      stage(next, count);
    done += count;
  }
  taken_ += taken;
  if (missing() == 0 && taken > 0) {
    if (staged_ > 0) {
      std::vector<Sample>& partial = staging<Sample>();
      std::fill(partial.begin() + static_cast<std::ptrdiff_t>(staged_), partial.end(), Sample{0});
      fold(partial.data(), std::exchange(staged_, 0));
    }
    if (folded_chunks_ > 0) accumulate();
  }
  return taken;
}

template <typename Sample>
void CombExtractor::State::stage(const Sample* samples, std::size_t frames) {
  const std::size_t channels = channel_sums_.size();
  Sample* const deflection = staging<Sample>().data() + staged_;
  for (std::size_t i = 0; i < frames; ++i) deflection[i] = samples[i * channels];
  for (std::size_t channel = 1; channel < channels; ++channel) {
    double sum = channel_sums_[channel];
    for (std::size_t i = 0; i < frames; ++i) sum += static_cast<double>(samples[i * channels + channel]);
    channel_sums_[channel] = sum;
  }
  staged_ += frames;
  if (staged_ == chunk_) {
    staged_ = 0;
    fold(staging<Sample>().data(), chunk_);
  }
}

template <typename Sample>
void CombExtractor::State::fold(const Sample* chunk, std::size_t valid) {
  float* const folded = folded_.get() + folded_chunks_ * chunk_;
  ChunkStatistics statistics{};
  if constexpr (std::is_same_v<Sample, std::int16_t>)
    statistics = kernels_.fold_i16(chunk, folded);
  else
    statistics = kernels_.fold_f32(chunk, folded);
  channel_sums_[0] += statistics.sum;
  const bool in_range = statistics.min > clip_lo_ && statistics.max < clip_hi_;
  if (!in_range) clipped_ += count_clipped(chunk, valid, clip_lo_, clip_hi_);
  if (++folded_chunks_ == group_chunks) accumulate();
}

void CombExtractor::State::accumulate() {
  kernels_.accumulate(folded_.get(), folded_chunks_, comb_.tones.size(), coefficients_.get(), advance_.data(),
                      state_.get());
  chunks_done_ += std::exchange(folded_chunks_, 0);
}

void CombExtractor::State::finish(std::span<std::complex<double>> phasors,
                                  std::span<double> channel_means) const {
  if (missing() != 0 || phasors.size() != comb_.tones.size() || channel_means.size() != channel_sums_.size())
    throw std::logic_error(
        "CombExtractor::finish: the span is not complete, or the outputs are of another size");
  const std::uint64_t n = comb_.window_samples;
  const std::size_t lanes = kernels_.lanes;
  const std::uint64_t last_chunk = first_sample_ + (chunks_done_ - 1) * chunk_;
  const auto samples = static_cast<double>(span_);
  for (std::size_t t = 0; t < phasors.size(); ++t) {
    const double* const re = state_.get() + 2 * t * lanes;
    const double* const im = re + lanes;
    std::complex<double> sum = 0.0;
    for (std::size_t lane = 0; lane < lanes; ++lane)
      sum += std::complex(re[lane], im[lane]) * lane_phase_[t * lanes + lane];
    const double phase = phase_radians(phase_index(comb_.tones[t].bin, last_chunk, n), n);
    phasors[t] = sum * std::polar(2.0 / samples, -phase);
  }
  for (std::size_t c = 0; c < channel_means.size(); ++c) channel_means[c] = channel_sums_[c] / samples;
}

std::uint64_t CombExtractor::State::clipped() const {
  return clipped_ + (format_ == SampleFormat::i16
                         ? count_clipped(staging_i16_.data(), staged_, clip_lo_, clip_hi_)
                         : count_clipped(staging_f32_.data(), staged_, clip_lo_, clip_hi_));
}

CombExtractor::CombExtractor(Comb comb, std::uint16_t channels, SampleFormat format, double clip_lo,
                             double clip_hi)
    : state_(std::make_unique<State>(std::move(comb), channels, format, clip_lo, clip_hi)) {}
CombExtractor::~CombExtractor() = default;
CombExtractor::CombExtractor(CombExtractor&&) noexcept = default;
CombExtractor& CombExtractor::operator=(CombExtractor&&) noexcept = default;

void CombExtractor::begin(std::uint64_t first_sample, std::uint32_t windows) {
  state_->begin(first_sample, windows);
}
std::size_t CombExtractor::add(const std::int16_t* samples, std::size_t frames) {
  return state_->add(samples, frames);
}
std::size_t CombExtractor::add(const float* samples, std::size_t frames) {
  return state_->add(samples, frames);
}
std::uint64_t CombExtractor::missing() const {
  return state_->missing();
}
void CombExtractor::finish(std::span<std::complex<double>> phasors, std::span<double> channel_means) const {
  state_->finish(phasors, channel_means);
}
std::uint64_t CombExtractor::clipped() const {
  return state_->clipped();
}
const Comb& CombExtractor::comb() const {
  return state_->comb();
}

}  // namespace combforce

// Now and then a power spectrum of the deflection, beside the real-time path: the extraction thread copies a
// stretch of the stream, and a thread of its own makes the spectrum of it.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <string_view>
#include <thread>
#include <vector>

#include "daemon/pipeline/analysis.hpp"
#include "drivers/digitizer.hpp"
#include "dsp/sample_block.hpp"
#include "dsp/spectrum.hpp"

namespace combforce {

// Welch's estimate (dsp/spectrum.hpp) over an unbroken stretch of the stream.
struct Spectrum {
  std::uint64_t first_sample = 0, samples = 0;
  std::uint64_t segments = 0;  // averaged, each half over the next: a bin scatters by about 1/sqrt(segments)
  double bin_hz = 0.0;
  // One-sided. nm^2/Hz where volts have one length: all modes of the cantilever share their sensitivity, or
  // without a cantilever the channel has nm_per_v. Otherwise V^2/Hz.
  std::string_view unit;
  std::vector<double> density;  // bins 0 … segment/2
};

// A stretch of channel 0 in codes, filled by the extraction thread, used by another.
class SpectrumTap {
 public:
  explicit SpectrumTap(std::size_t most_samples) : codes_(most_samples) {}

  // Extraction thread; neither allocates nor locks, and wakes the other thread once a stretch. A gap starts
  // the stretch again.
  void add(const SampleBlock& block);

  // The other thread: fill it with the next `samples`; wait until it is. False: cancelled.
  void arm(std::size_t samples);
  bool wait_full();
  std::span<const float> codes() const { return {codes_.data(), wanted_}; }
  std::uint64_t first_sample() const { return first_sample_; }

  void cancel();  // any thread: ends the wait, now and from now on

 private:
  enum class State : std::uint32_t { idle, armed, full, cancelled };
  std::atomic<State> state_{State::idle};
  std::vector<float> codes_;
  std::size_t wanted_ = 0, filled_ = 0;
  std::uint64_t first_sample_ = 0;
  std::uint32_t epoch_ = 0;
};

class SpectrumMonitor {
 public:
  static constexpr double least_hz = 1e-3, most_hz = 10.0;

  // `segment` samples a segment, even; `analysis` gives the analysis in force, from any thread. `publish` is
  // called from the monitor's thread.
  SpectrumMonitor(const StreamInfo& info, std::size_t segment,
                  std::function<std::shared_ptr<const Analysis>()> analysis,
                  std::function<void(const Spectrum&)> publish);
  ~SpectrumMonitor();
  SpectrumMonitor(const SpectrumMonitor&) = delete;
  SpectrumMonitor& operator=(const SpectrumMonitor&) = delete;

  // Spectra a second, in [least_hz, most_hz]; 0: none. Fewer come where the stream is too slow for a segment
  // in that time. Thread-safe.
  void set_rate(double hz);
  SpectrumTap& tap() { return tap_; }

 private:
  void run();
  std::size_t stretch(double hz) const;
  void make(const Analysis& analysis);

  const double sample_rate_hz_;
  const std::size_t segment_;
  const std::function<std::shared_ptr<const Analysis>()> analysis_;
  const std::function<void(const Spectrum&)> publish_;
  SpectrumTap tap_;
  WelchSpectrum welch_;
  std::mutex mutex_;  // of what follows
  std::condition_variable changed_;
  double hz_ = 0.0;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace combforce

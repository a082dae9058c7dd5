#include "daemon/cli/calibrate_source.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <thread>
#include <utility>

#include "daemon/cli/client.hpp"
#include "daemon/cli/interrupt_flag.hpp"
#include "daemon/cli/progress.hpp"
#include "drivers/replay/replay_digitizer.hpp"
#include "dsp/spectrum.hpp"

namespace combforce {
namespace {

std::size_t segment_for(const std::vector<OscillatorStart>& modes, double sample_rate_hz) {
  constexpr double ring_downs = 30.0;
  double longest_s = 0.0;
  for (const OscillatorStart& mode : modes)
    longest_s = std::max(longest_s, mode.quality_factor / (std::numbers::pi * mode.frequency_hz));
  constexpr std::size_t least = 256, most = std::size_t{1} << 26;
  std::size_t samples = least;
  while (samples < most && static_cast<double>(samples) < ring_downs * longest_s * sample_rate_hz)
    samples *= 2;
  return samples;
}

// Takes the blocks of a stream; stretches between gaps are runs.
class StreamSpectrum {
 public:
  StreamSpectrum(std::size_t segment_samples, double sample_rate_hz, Channel channel)
      : welch_(segment_samples, sample_rate_hz), channel_(std::move(channel)) {}

  void add(const SampleBlock& block) {
    const BlockHeader& header = block.header;
    frames_ += header.frames;
    if (!first_ && (header.lost_before > 0 || header.epoch != epoch_)) {
      welch_.break_off();
      ++gaps_;
      continues_ = false;
    }
    first_ = false;
    epoch_ = header.epoch;
    const auto [clip_lo, clip_hi] = clip_codes_of(channel_, header.format);
    volts_.resize(header.frames);
    for (std::size_t i = 0; i < volts_.size(); ++i) {
      const std::size_t at = i * header.channels;
      const double code = header.format == SampleFormat::i16 ? static_cast<double>(block.i16()[at])
                                                             : static_cast<double>(block.f32()[at]);
      if (code <= clip_lo || code >= clip_hi) ++clipped_;
      volts_[i] = channel_.scale * code + channel_.offset;
    }
    const std::uint64_t before = welch_.segments();
    welch_.push(volts_);
    if (welch_.segments() == before) return;
    if (!continues_) ++runs_;
    continues_ = true;
  }

  const WelchSpectrum& welch() const { return welch_; }
  std::uint64_t frames() const { return frames_; }
  std::uint64_t gaps() const { return gaps_; }
  std::uint64_t runs() const { return runs_; }
  std::uint64_t clipped() const { return clipped_; }

 private:
  WelchSpectrum welch_;
  Channel channel_;
  std::vector<double> volts_;
  bool first_ = true, continues_ = false;
  std::uint32_t epoch_ = 0;
  std::uint64_t frames_ = 0, gaps_ = 0, runs_ = 0, clipped_ = 0;
};

void run(ReplayDigitizer& digitizer, StreamSpectrum& spectrum) {
  const StreamInfo& info = digitizer.info();
  constexpr std::size_t slots = 16;
  BlockSink sink(slots, std::size_t{info.block_frames} * info.channels.size() * sample_bytes(info.format),
                 info.when_full);
  digitizer.start(sink);
  for (bool last = false; !last;) {
    sink.wait_extraction();
    last = sink.closed() || sink.cancelled();
    while (const SampleBlock* block = sink.extraction().front()) {
      spectrum.add(*block);
      sink.extraction().release();
      sink.released();
    }
  }
  digitizer.stop();
  if (const StreamStatus status = digitizer.status(); status.state == StreamState::failed)
    throw InputError("", "", status.reason);
}

}  // namespace

ThermalSource read_density(const std::string& path, const SpectrumFileOptions& options) {
  SpectrumFile file = read_spectrum_file(path, options.column);
  ThermalSource source;
  source.name = path;
  source.vendor = file.vendor;
  source.averages_known = options.averages > 0.0;
  source.spectrum = {file.first_hz, file.bin_hz, std::move(file.density), {}, std::nullopt};
  if (options.averages > 0.0) source.spectrum.statistics.averages = options.averages;
  if (options.two_sided)
    for (double& density : source.spectrum.density) density *= 2.0;
  if (!options.hann) return source;
  const double bins = file.first_hz / file.bin_hz;
  constexpr double tolerance = 0.01;
  if (std::abs(bins - std::round(bins)) > tolerance)
    throw InputError(
        path, "",
        fmt::format("first frequency {} Hz, must be a multiple of the step {} Hz for --window hann",
                    file.first_hz, file.bin_hz));
  const std::size_t samples =
      2 * (static_cast<std::size_t>(std::lround(bins)) + source.spectrum.density.size() - 1);
  source.spectrum.record = HannRecord{samples, file.bin_hz * static_cast<double>(samples)};
  source.spectrum.statistics.correlation = hann_correlation;
  return source;
}

ThermalSource read_stream(const std::string& recording, const Description& configured,
                          const std::vector<OscillatorStart>& modes, const StreamOptions& options) {
  ReplayDigitizer digitizer(recording, {.realtime = false, .verify = options.verify});
  ThermalSource source;
  source.name = sigmf_paths(recording).meta;
  source.warnings = digitizer.warnings();
  source.description = overlay(digitizer.meta().description, configured);
  const StreamInfo& info = digitizer.info();
  const Channels& channels = source.description.channels ? *source.description.channels : info.channels;
  const std::size_t segment =
      options.segment_samples > 0 ? options.segment_samples : segment_for(modes, info.sample_rate_hz);
  StreamSpectrum stream(segment, info.sample_rate_hz, channels.front());
  run(digitizer, stream);
  source.segments = stream.welch().segments();
  source.gaps = stream.gaps();
  source.clipped = stream.clipped();
  if (source.clipped > 0)
    source.warnings.push_back(
        fmt::format("{}: {} of {} samples are clipped: the thermal signal is greater than it says",
                    source.name, source.clipped, stream.frames()));
  if (source.segments == 0)
    throw InputError(source.name, "",
                     fmt::format("{} samples, no stretch of them as long as a segment of {} samples",
                                 stream.frames(), segment));
  source.spectrum = {0.0, stream.welch().bin_hz(), stream.welch().density(),
                     hann_statistics(source.segments, stream.runs()),
                     HannRecord{segment, info.sample_rate_hz}};
  return source;
}

std::string record_live(const std::string& connect, double seconds) {
  Client client(connect);
  const Json info = client.call("instrument.info");
  const auto wanted = static_cast<std::uint64_t>(std::ceil(seconds * info.value("sample_rate_hz", 0.0)));
  const std::string path = client.call("record.start").value("meta_path", "");
  const InterruptFlag interrupt;
  Progress progress;
  bool ended = false;
  while (!ended && !InterruptFlag::raised()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    const Json status = client.call("instrument.status");
    const std::uint64_t frames = status["record"].value("frames", std::uint64_t{0});
    progress.show(fmt::format("recorded {} of {} samples", frames, wanted));
    ended = frames >= wanted || status.value("state", "") != "running" || status["recording"] != true;
  }
  progress.clear();
  const Json summary = client.call("record.stop");
  if (InterruptFlag::raised()) throw std::runtime_error(fmt::format("interrupted; {} is not used", path));
  if (!summary.value("complete", false))
    throw std::runtime_error(fmt::format("the recording is not complete: {}", summary.value("failure", "")));
  return path;
}

}  // namespace combforce

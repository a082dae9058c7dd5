#include "drivers/simulated/sample_source.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "dsp/pixel_clock.hpp"

namespace combforce {

using Complex = std::complex<double>;

namespace {

// A pixel boundary marks at most: a step, and a line or the end of the scan.
constexpr std::uint32_t marks_a_boundary = 2;
OscillatorSettings oscillator_settings(const SimulationSettings& settings) {
  OscillatorSettings oscillator;
  oscillator.sample_rate_hz = settings.sample_rate_hz;
  oscillator.cantilever = settings.cantilever;
  oscillator.window_samples = settings.comb.window_samples;
  for (const Tone& tone : settings.comb.tones) {
    if (tone.driven) oscillator.drive_bins.push_back(tone.bin);
  }
  oscillator.drive_forces_nn = drive_forces(settings);
  oscillator.temperature_k = settings.temperature_k;
  oscillator.seed = settings.seed;
  oscillator.accuracy = settings.accuracy;
  return oscillator;
}

SimulationSettings validated(const SimulationSettings& settings) {
  validate(settings);
  return settings;
}

void mark(BlockHeader& header, StreamMark::Kind kind, std::uint64_t sample, const LineMark& line = {}) {
  header.marks[header.mark_count++] = {kind, sample, line};
}

std::int16_t to_code(double value) {
  using Code = std::numeric_limits<std::int16_t>;
  return static_cast<std::int16_t>(std::lrint(std::clamp<double>(value, Code::min(), Code::max())));
}

}  // namespace

SampleSource::SampleSource(const SimulationSettings& settings)
    : settings_(validated(settings)),
      model_(find_model(settings.model)),
      channels_(simulated_channels(settings)),
      oscillator_(oscillator_settings(settings)),
      detector_noise_(settings.seed, 1),
      detector_sigma_v_(settings.detector_nm_per_sqrt_hz * std::sqrt(0.5 * settings.sample_rate_hz) /
                        std::abs(settings.cantilever.modes[0].sensitivity_nm_per_v)),
      tip_nm_per_code_(
          std::abs(tip_per_volt(settings.cantilever, tone_hz(settings, settings.comb.tones[0]))) *
          channels_[0].scale),
      amplitude_({settings.comb.window_samples, {settings.comb.tones[0]}},
                 static_cast<std::uint16_t>(channels_.size()), SampleFormat::i16,
                 std::numeric_limits<std::int16_t>::min(), std::numeric_limits<std::int16_t>::max()),
      z_nm_(settings.feedback.start_z_nm) {
  set_point_nm_ = settings_.feedback.set_point * std::abs(exact_free_response(settings_)[0]);
}

void SampleSource::start_scan(const ScanLayout& layout, std::uint32_t frames, SceneMaps scene) {
  layout_ = layout;
  scene_ = std::move(scene);
  raster_.emplace(layout, frames, next_sample());
  z_nm_ = settings_.feedback.start_z_nm;
}

void SampleSource::stop_scan() {
  stop_scan_ = scanning();
}

void SampleSource::set_drive(const Drive& drive) {
  new_drive_ = drive;
}

void SampleSource::append(std::uint32_t frames, BlockHeader& header, std::vector<std::int16_t>& codes) {
  const std::uint64_t end = next_sample() + frames;
  while (next_sample() < end) {
    if (at_boundary()) {
      if (header.mark_count + marks_a_boundary > BlockHeader::max_marks) return;
      pass_boundary(header);
    }
    const std::uint64_t part_end = pixel_ ? std::min(end, pixel_->end_sample) : end;
    const std::uint64_t part = part_end - next_sample();
    generate(static_cast<std::size_t>(part), codes);
    header.frames += static_cast<std::uint32_t>(part);
  }
}

void SampleSource::pass_boundary(BlockHeader& header) {
  if (pixel_) update_feedback();
  if (new_drive_) {
    settings_.drive = *std::exchange(new_drive_, std::nullopt);
    oscillator_.set_drive(drive_forces(settings_));
    set_point_nm_ = settings_.feedback.set_point * std::abs(exact_free_response(settings_)[0]);
    mark(header, StreamMark::Kind::step, next_sample());
  }
  if (!raster_) return;
  pixel_ = std::exchange(stop_scan_, false) ? std::nullopt : raster_->next();
  if (pixel_) {
    begin_pixel(header);
  } else {
    raster_.reset();
    oscillator_.withdraw();
    mark(header, StreamMark::Kind::scan_ended, next_sample());
  }
}

void SampleSource::begin_pixel(BlockHeader& header) {
  if (pixel_->begins_line) mark(header, StreamMark::Kind::line, next_sample(), pixel_->mark);
  const std::size_t i = scene_.index(pixel_->line, pixel_->column);
  PixelTruth of_pixel{pixel_->mark.frame,     pixel_->line,         pixel_->column,
                      pixel_->mark.direction, pixel_->first_sample, {scene_.height_nm[i] - z_nm_}};
  for (const std::vector<double>& map : scene_.parameters) of_pixel.parameters.push_back(map[i]);
  oscillator_.engage(model_, of_pixel.parameters);
  if (pixel_->in_line && truth) truth(of_pixel);
  amplitude_.begin(analysis_first(), layout_.windows);
}

std::uint64_t SampleSource::analysis_first() const {
  return pixel_->end_sample - layout_.windows * settings_.comb.window_samples;
}

void SampleSource::generate(std::size_t frames, std::vector<std::int16_t>& codes) {
  const std::uint64_t first = next_sample();
  volts_.resize(frames);
  oscillator_.advance(volts_);
  const std::size_t start = codes.size();
  convert(first, codes);
  if (!pixel_) return;
  const std::uint64_t skipped = analysis_first() > first ? analysis_first() - first : 0;
  if (skipped < frames) {
    amplitude_.add(codes.data() + start + skipped * channels_.size(),
                   static_cast<std::size_t>(frames - skipped));
  }
}

void SampleSource::convert(std::uint64_t first_sample, std::vector<std::int16_t>& codes) {
  const std::size_t start = codes.size();
  const std::size_t channels = channels_.size();
  codes.resize(start + volts_.size() * channels,
               channels > 1 ? to_code(z_nm_ / channels_[1].scale) : std::int16_t{0});
  if (detector_sigma_v_ > 0.0) {
    for (double& volts : volts_) volts += detector_sigma_v_ * detector_noise_.normal();
  }
  const double codes_per_volt = 1.0 / channels_[0].scale;
  for (std::size_t i = 0; i < volts_.size(); ++i)
    codes[start + i * channels] = to_code(volts_[i] * codes_per_volt);
  const std::uint64_t end = first_sample + volts_.size();
  for (const FaultSettings& fault : settings_.faults) {
    if (fault.kind != FaultSettings::Kind::clipped) continue;
    const std::uint64_t clip_end = std::min(end, fault.sample + fault.frames);
    for (std::uint64_t n = std::max(first_sample, fault.sample); n < clip_end; ++n) {
      codes[start + (n - first_sample) * channels] = std::numeric_limits<std::int16_t>::max();
    }
  }
}

// The amplitude of a pixel that clipped says nothing: z stays.
void SampleSource::update_feedback() {
  if (!settings_.feedback.enabled || amplitude_.clipped() > 0) return;
  Complex phasor;
  std::vector<double> means(channels_.size());
  amplitude_.finish({&phasor, 1}, means);
  z_nm_ += settings_.feedback.gain * (set_point_nm_ - std::abs(phasor) * tip_nm_per_code_);
}

}  // namespace combforce

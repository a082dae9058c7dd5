#include "daemon/pipeline/analysis.hpp"

#include <fmt/format.h>

#include <limits>
#include <stdexcept>
#include <utility>

#include "dsp/pixel_clock.hpp"
#include "fit/cantilever.hpp"

namespace combforce {
namespace {

ScanLayout layout_of(const Description& description) {
  ScanLayout layout = description.scan.value_or(ScanLayout{});
  const std::uint64_t least = layout.settle_samples + layout.windows * description.comb->window_samples;
  if (!description.scan || layout.pixel_samples == 0) layout.pixel_samples = least;
  return layout;
}

FitConditions conditions_of(const StreamInfo& info, const Analysis& analysis) {
  const Description& description = analysis.description;
  return {.sample_rate_hz = info.sample_rate_hz,
          .comb = *description.comb,
          .windows = analysis.layout.windows,
          .cantilever = description.cantilever.value_or(Cantilever{}),
          .excitation = description.excitation.value_or(Excitation{}),
          .free_response = description.free_response,
          .noise = description.noise,
          .settings = description.fit.value_or(FitSettings{})};
}

CombExtractor extractor_of(const StreamInfo& info, const Analysis& analysis) {
  const Channel& deflection = analysis.description.channels->front();
  const auto [lo, hi] = clip_codes_of(deflection, info.format);
  return {*analysis.description.comb, static_cast<std::uint16_t>(info.channels.size()), info.format, lo, hi};
}

}  // namespace

std::complex<double> nm_per_volt(const Description& description, double frequency_hz) {
  if (description.cantilever) return tip_per_volt(*description.cantilever, frequency_hz);
  return description.channels ? description.channels->front().nm_per_v.value_or(1.0) : 1.0;
}

std::shared_ptr<const Analysis> make_analysis(const StreamInfo& info, Description description) {
  if (!description.comb)
    throw std::invalid_argument(
        "comb: missing: neither recording nor configuration says which tones to extract");
  if (!description.channels) description.channels = info.channels;
  if (description.channels->size() != info.channels.size())
    throw std::invalid_argument(fmt::format("channels: {} described, but the stream has {}",
                                            description.channels->size(), info.channels.size()));
  auto analysis = std::make_shared<Analysis>();
  validate(*description.comb);
  analysis->description = std::move(description);
  const Description& described = analysis->description;
  analysis->layout = layout_of(described);
  validate(analysis->layout, described.comb->window_samples);
  if (described.cantilever) validate(*described.cantilever);
  const double delta_f_hz = info.sample_rate_hz / static_cast<double>(described.comb->window_samples);
  for (const Tone& tone : described.comb->tones)
    analysis->tip_per_volt.push_back(nm_per_volt(described, static_cast<double>(tone.bin) * delta_f_hz));
  if (described.cantilever) {
    analysis->ring_down_samples = longest_ring_down_s(*described.cantilever) * info.sample_rate_hz;
    validate(conditions_of(info, *analysis));
    analysis->model = &find_model(described.fit.value_or(FitSettings{}).model);
  }
  return analysis;
}

AnalysisStage::AnalysisStage(const StreamInfo& info, std::shared_ptr<const Analysis> of, unsigned workers)
    : analysis(std::move(of)), extractor(extractor_of(info, *analysis)) {
  if (analysis->model == nullptr) return;
  const FitConditions conditions = conditions_of(info, *analysis);
  for (unsigned i = 0; i < workers; ++i) fitters.emplace_back(conditions);
}

std::size_t AnalysisStage::add(const SampleBlock& block, std::uint64_t from, std::uint64_t until) {
  const std::size_t offset = (from - block.header.first_sample) * block.header.channels;
  const std::size_t frames = until - from;
  return block.header.format == SampleFormat::i16 ? extractor.add(block.i16().data() + offset, frames)
                                                  : extractor.add(block.f32().data() + offset, frames);
}

}  // namespace combforce

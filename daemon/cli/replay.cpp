// combforce replay: a recording through the very pipeline the daemon runs.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <condition_variable>
#include <cstdio>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "config/configuration.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/exit_code.hpp"
#include "daemon/cli/line_output.hpp"
#include "daemon/cli/maps.hpp"
#include "daemon/cli/progress.hpp"
#include "daemon/instrument.hpp"
#include "fit/force_model.hpp"
#include "proto/pixel_message.hpp"
#include "proto/sigmf.hpp"

namespace combforce {
namespace {

struct ReplayCommand {
  std::string recording, config, model, output, maps;
  std::string fields = "all";
  std::optional<unsigned> refine;
  unsigned threads = 0;
  bool realtime = false, no_verify = false, json = false;
};

std::vector<std::string> model_names() {
  std::vector<std::string> names;
  for (const ModelInfo& model : force_models()) names.emplace_back(model.name);
  return names;
}

PixelFields fields_of(const std::string& name) {
  return name == "fit" ? PixelFields::fit : name == "tones" ? PixelFields::tones : PixelFields::all;
}

// recording < file < command line, of which the fit is the one object the command line changes in part.
Configuration configure(const ReplayCommand& options) {
  Configuration configuration = options.config.empty() ? Configuration{} : load_configuration(options.config);
  configuration.digitizer.kind = DigitizerSettings::Kind::replay;
  configuration.digitizer.replay.recording = sigmf_paths(options.recording).meta;
  if (options.realtime) configuration.digitizer.replay.realtime = true;
  if (options.no_verify) configuration.digitizer.replay.verify = false;
  if (options.threads > 0) configuration.pipeline.threads = options.threads;
  if (options.model.empty() && !options.refine) return configuration;
  std::optional<FitSettings>& fit = configuration.description.fit;
  if (!fit)
    fit = read_sigmf_meta(configuration.digitizer.replay.recording).description.fit.value_or(FitSettings{});
  if (!options.model.empty() && options.model != fit->model) {
    fit->model = find_model(options.model).name;
    fit->bounds.clear();
    std::erase(fit->compare, fit->model);
  }
  if (options.refine) fit->refine = *options.refine;
  return configuration;
}

// What replay reports when it is done. Amplitudes: means of |D| over the pixels without a flag.
class Summary {
 public:
  void add(const RetiredPixel& pixel) {
    ++counts_.pixels;
    ++counts_.by_status[static_cast<std::size_t>(pixel.fit.status)];
    bins_.resize(pixel.tip_nm.size());
    amplitudes_.resize(pixel.tip_nm.size());
    for (std::size_t i = 0; i < bins_.size(); ++i) bins_[i] = pixel.analysis.description.comb->tones[i].bin;
    if (pixel.pixel.flags.any()) return;
    ++unflagged_;
    for (std::size_t i = 0; i < bins_.size(); ++i) amplitudes_[i] += std::abs(pixel.tip_nm[i]);
  }

  Json json() const {
    Json tones = Json::array();
    for (std::size_t i = 0; i < bins_.size(); ++i)
      tones.push_back({{"bin", bins_[i]}, {"mean_amplitude_nm", number9(mean(i))}});
    Json statuses = Json::object();
    for (std::size_t i = 0; i < counts_.by_status.size(); ++i)
      if (counts_.by_status[i] > 0)
        statuses[std::string(to_string(static_cast<FitStatus>(i)))] = counts_.by_status[i];
    return {{"pixels", counts_.pixels}, {"unflagged", unflagged_}, {"status", statuses}, {"tones", tones}};
  }

  std::string text() const {
    std::string out = fmt::format("{} pixels:", counts_.pixels);
    for (std::size_t i = 0; i < counts_.by_status.size(); ++i)
      if (counts_.by_status[i] > 0)
        out += fmt::format(" {} {}", counts_.by_status[i], to_string(static_cast<FitStatus>(i)));
    out += "\n";
    for (std::size_t i = 0; i < bins_.size(); ++i)
      out += fmt::format("  bin {:>8}  mean amplitude {:.6g} nm\n", bins_[i], mean(i));
    return out;
  }

 private:
  double mean(std::size_t tone) const {
    return unflagged_ > 0 ? amplitudes_[tone] / static_cast<double>(unflagged_) : std::nan("");
  }

  PixelCounts counts_;
  std::uint64_t unflagged_ = 0;
  std::vector<std::uint64_t> bins_;
  std::vector<double> amplitudes_;
};

// Where pixels go. They come on the pipeline's output thread, where nothing may throw: the first failure is
// kept for the main thread, and no pixel after it is written.
class ReplayOutputs {
 public:
  explicit ReplayOutputs(const ReplayCommand& options)
      : options_(options), fields_(fields_of(options.fields)), maps_(options.maps) {}

  // To be called before the stream starts, once all inputs are known to be good: an existing file is emptied.
  void open(const Configuration& configuration) {
    if (options_.output.empty()) return;
    const SigmfPaths recording = sigmf_paths(configuration.digitizer.replay.recording);
    refuse_input(options_.output, {recording.meta, recording.data, options_.config});
    output_.emplace(options_.output);
  }

  PipelineOutputs pipeline_outputs() {
    PipelineOutputs outputs;
    outputs.pixel = [this](const RetiredPixel& pixel) { take(pixel); };
    outputs.event = [this](const Event& event) { take(event); };
    return outputs;
  }

  // Until the last pixel is out. False: earlier, as one could not be written.
  bool wait() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return ended_ || failure_ != nullptr; });
    return failure_ == nullptr;
  }

  void finish() {
    progress_.clear();
    if (failure_ != nullptr) std::rethrow_exception(failure_);
    if (output_) output_->close();
    if (!options_.maps.empty()) maps_.write();
    if (options_.json)
      fmt::print("{}\n", summary_.json().dump());
    else if (options_.output != "-")
      fmt::print("{}", summary_.text());
  }

 private:
  void take(const RetiredPixel& pixel) {
    if (failure_ != nullptr) return;
    try {
      write(pixel);
    } catch (...) {
      const std::scoped_lock lock(mutex_);
      failure_ = std::current_exception();
      changed_.notify_all();
    }
  }

  void write(const RetiredPixel& pixel) {
    summary_.add(pixel);
    if (output_) write_line(pixel);
    if (!options_.maps.empty()) maps_.add(map_pixel(pixel));
    const PixelSpan& span = pixel.pixel.span;
    if (progress_.due())
      progress_.show(fmt::format("frame {} line {} column {}", span.frame, span.line, span.column));
  }

  void write_line(const RetiredPixel& pixel) {
    const Description& description = pixel.analysis.description;
    line_.clear();
    append_pixel_line(line_,
                      {pixel.pixel, *description.comb, *description.channels, pixel.tip_nm,
                       pixel.analysis.model, pixel.fit, pixel.analysis.tip()},
                      fields_);
    output_->write(line_);
  }

  void take(const Event& event) {
    if (event.kind == "stream_ended") {
      const std::scoped_lock lock(mutex_);
      ended_ = true;
      changed_.notify_all();
    }
    if (event.kind == "stream_ended" || event.kind == "scan_ended") return;
    progress_.clear();
    const std::string text = fmt::format("combforce: {}: {} (sample {}, {} frames)\n", event.kind, event.text,
                                         event.first_sample, event.count);
    std::fputs(text.c_str(), stderr);
  }

  const ReplayCommand& options_;
  const PixelFields fields_;
  std::optional<LineOutput> output_;
  MapWriter maps_;
  Summary summary_;
  Progress progress_;
  std::string line_;
  std::mutex mutex_;  // of what follows; only the output thread sets it
  std::condition_variable changed_;
  bool ended_ = false;
  std::exception_ptr failure_;
};

// What does not fit together, said of the files that it comes from.
Instrument open_instrument(const ReplayCommand& options, const Configuration& configuration,
                           const PipelineOutputs& outputs) {
  try {
    return {configuration, outputs};
  } catch (const std::invalid_argument& error) {
    const std::string& recording = configuration.digitizer.replay.recording;
    throw InputError(options.config.empty() ? recording : recording + " with " + options.config, "",
                     error.what());
  }
}

int run_replay(const ReplayCommand& options) {
  const Configuration configuration = configure(options);
  ReplayOutputs outputs(options);
  Instrument instrument = open_instrument(options, configuration, outputs.pipeline_outputs());
  outputs.open(configuration);
  instrument.start();
  if (outputs.wait())
    instrument.wait();
  else
    instrument.stop();
  outputs.finish();
  const StreamStatus stream = instrument.status().stream;
  if (stream.state == StreamState::failed) throw InputError("", "", stream.reason);
  return exit_done;
}

}  // namespace

void add_replay(CLI::App& app, Command& command) {
  auto options = std::make_shared<ReplayCommand>();
  CLI::App* replay = app.add_subcommand("replay", "Extract and fit a SigMF recording");
  replay->add_option("recording", options->recording, "REC.sigmf-meta")->required();
  replay->add_option("--config", options->config, "what the recording lacks, or what overrides it");
  replay->add_option("--model", options->model, "force model instead of the recorded one")
      ->check(CLI::IsMember(model_names()));
  replay->add_option("--refine", options->refine, "at most this many refinements (0: the paper's method)")
      ->check(CLI::Range(0U, FitSettings::most_refinements));
  replay->add_option("--output", options->output, "pixel lines, as a live subscriber gets them (-: stdout)");
  replay->add_option("--fields", options->fields, "what a pixel line carries")
      ->check(CLI::IsMember({"fit", "tones", "all"}));
  replay->add_option("--maps", options->maps, "directory for maps of the parameters (GSF)");
  replay->add_option("--threads", options->threads, "fit workers (0: one a core)")
      ->check(CLI::Range(0U, 1024U));
  replay->add_flag("--realtime", options->realtime, "at the recorded rate, dropping like a live source");
  replay->add_flag("--no-verify", options->no_verify, "do not check core:sha512");
  replay->add_flag("--json", options->json, "summary as JSON");
  replay->callback([options, &command] { command = [options] { return run_replay(*options); }; });
}

}  // namespace combforce

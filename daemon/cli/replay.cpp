// combforce replay: a recording through the very pipeline the daemon runs.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/configuration.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/exit_code.hpp"
#include "daemon/cli/line_output.hpp"
#include "daemon/cli/maps.hpp"
#include "daemon/cli/progress.hpp"
#include "daemon/instrument.hpp"
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

int run_replay(const ReplayCommand& options) {
  const Configuration configuration = configure(options);
  const PixelFields fields = fields_of(options.fields);
  std::optional<LineOutput> output;
  if (!options.output.empty()) output.emplace(options.output);
  std::optional<MapWriter> maps;
  if (!options.maps.empty()) maps.emplace(options.maps);
  Summary summary;
  Progress progress;
  std::string line;
  PipelineOutputs outputs;
  outputs.pixel = [&](const RetiredPixel& pixel) {
    summary.add(pixel);
    const Description& description = pixel.analysis.description;
    if (output) {
      line.clear();
      append_pixel_line(line,
                        {pixel.pixel, *description.comb, *description.channels, pixel.tip_nm,
                         pixel.analysis.model, pixel.fit, pixel.analysis.tip()},
                        fields);
      output->write(line);
    }
    if (maps) maps->add(map_pixel(pixel));
    if (progress.due())
      progress.show(fmt::format("frame {} line {} column {}", pixel.pixel.span.frame, pixel.pixel.span.line,
                                pixel.pixel.span.column));
  };
  outputs.event = [&](const Event& event) {
    if (event.kind == "stream_ended" || event.kind == "scan_ended") return;
    progress.clear();
    fmt::print(stderr, "combforce: {}: {} (sample {}, {} frames)\n", event.kind, event.text,
               event.first_sample, event.count);
  };
  Instrument instrument(configuration, outputs);
  instrument.start();
  instrument.wait();
  progress.clear();
  if (output) output->close();
  if (maps) maps->write();
  const StreamStatus stream = instrument.status().stream;
  if (options.json)
    fmt::print("{}\n", summary.json().dump());
  else if (options.output != "-")
    fmt::print("{}", summary.text());
  if (stream.state == StreamState::failed) throw InputError("", "", stream.reason);
  return exit_done;
}

}  // namespace

void add_replay(CLI::App& app, Command& command) {
  auto options = std::make_shared<ReplayCommand>();
  CLI::App* replay = app.add_subcommand("replay", "Extract and fit a SigMF recording");
  replay->add_option("recording", options->recording, "REC.sigmf-meta")->required();
  replay->add_option("--config", options->config, "what the recording lacks, or what overrides it");
  replay->add_option("--model", options->model, "force model instead of the recorded one");
  replay->add_option("--refine", options->refine, "at most this many refinements (0: the paper's method)");
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

// combforce watch: follow the daemon's notifications; print them, collect maps, compare with a simulated
// scene.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "config/configuration.hpp"
#include "daemon/cli/client.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/exit_code.hpp"
#include "daemon/cli/interrupt_flag.hpp"
#include "daemon/cli/line_output.hpp"
#include "daemon/cli/maps.hpp"
#include "daemon/cli/number_checks.hpp"
#include "daemon/cli/pixel_reader.hpp"
#include "daemon/cli/progress.hpp"
#include "daemon/cli/scene_report.hpp"

namespace combforce {

namespace {

struct WatchOptions {
  std::string connect, output, maps, truth;
  std::vector<std::string> topics{"pixel"};
  std::string fields = "all";
  std::uint64_t every = 1;
  std::uint64_t count = 0;   // 0: no limit
  std::uint64_t frames = 0;  // 0: no limit
  bool start_scan = false, json = false;

  bool collects() const { return !maps.empty() || !truth.empty(); }
  bool wants(const std::string& topic) const { return std::ranges::find(topics, topic) != topics.end(); }
};

class Watch {
 public:
  explicit Watch(const WatchOptions& options)
      : options_(options), client_(options.connect), maps_(options.maps) {
    const std::string output = options.output.empty() && !options.collects() ? "-" : options.output;
    if (!output.empty()) output_.emplace(output);
    progress_shown_ = output != "-" || ::isatty(STDOUT_FILENO) == 0;
  }

  // Until what was asked for is there, or no more will come. Throws when that is too little.
  void follow() {
    subscribe();
    while (!enough() && !ended_ && !InterruptFlag::raised()) {
      const auto line = client_.next(std::chrono::milliseconds(200));
      if (line) take(*line);
    }
    progress_.clear();
  }

  // Also of what came before follow() failed.
  void write_maps() const {
    if (!options_.maps.empty() && maps_.lines() > 0) maps_.write();
  }

  void finish() {
    if (output_) output_->close();
    write_maps();
    if (!options_.truth.empty()) report();
    if (skipped_ > 0) {
      throw std::runtime_error(fmt::format("{} pixels were skipped: this client was too slow", skipped_));
    }
    if (!enough() && (options_.frames > 0 || options_.count > 0)) {
      throw std::runtime_error(fmt::format("{} after {} lines and {} whole frames",
                                           ended_ ? "the stream ended" : "interrupted", printed_, frames_));
    }
  }

 private:
  bool enough() const {
    return (options_.frames > 0 && frames_ >= options_.frames) ||
           (options_.count > 0 && printed_ >= options_.count);
  }

  void subscribe() {
    std::vector<std::string> topics = options_.topics;
    for (const char* needed : {"frame", "event"}) {
      if (!options_.wants(needed)) topics.emplace_back(needed);
    }
    if (options_.collects() && !options_.wants("pixel")) topics.emplace_back("pixel");
    client_.call("subscribe",
                 {{"topics", topics}, {"tones", options_.fields == "all"}, {"every", options_.every}});
    if (options_.start_scan)
      client_.call("scan.start", {{"frames", std::max<std::uint64_t>(options_.frames, 1)}});
    const std::string source = "instrument.info";
    const Json info = client_.call(source);
    if (const auto scan = JsonView(info, source).find("scan"))
      layout_ = decode_scan(*scan, UnknownKeys::allow);
  }

  void take(const std::string& line) {
    const Json message = parse_json(line, options_.connect);
    const std::string topic = message.value("method", "");
    const Json params = message.value("params", Json::object());
    if (topic == "pixel") take_pixel(params);
    if (topic == "frame") take_frame(params);
    if (topic == "event") take_event(params);
    if (!output_ || !options_.wants(topic) || enough_printed()) return;
    output_->write(line);
    output_->write("\n");
    output_->flush();
    ++printed_;
  }

  bool enough_printed() const { return options_.count > 0 && printed_ >= options_.count; }

  void take_pixel(const Json& params) {
    ++pixels_of_frame_;
    if (options_.collects()) {
      MapPixel pixel = read_pixel(params);
      if (layout_) pixel.size_nm = layout_->size_nm;
      maps_.add(pixel);
    }
    if (progress_shown_ && progress_.due()) {
      progress_.show(fmt::format("frame {} line {} column {}", params.value("frame", 0),
                                 params.value("line", 0), params.value("column", 0)));
    }
  }

  // A frame that was cut is not whole, nor is one that was already under way when this client came.
  void take_frame(const Json& params) {
    const std::uint64_t pixels = params.value("counts", Json::object()).value("pixels", std::uint64_t{0});
    const bool counted = options_.wants("pixel") || options_.collects();
    const bool seen = !counted || options_.every > 1 || pixels_of_frame_ >= pixels;
    if (seen && params.value("whole", true)) ++frames_;
    pixels_of_frame_ = 0;
  }

  void take_event(const Json& params) {
    const std::string kind = params.value("kind", "");
    if (kind == "skipped") {
      const auto count = params.value("count", std::uint64_t{0});
      const std::string topic = params.value("topic", "");
      if (topic == "pixel") {
        skipped_ += count;
        pixels_of_frame_ += count;
      }
      if (topic == "frame") frames_ += count;
    }
    ended_ = ended_ || kind == "stream_ended";
    if (kind == "stream_ended" || kind == "scan_ended") return;
    progress_.clear();
    fmt::print(stderr, "combforce: {} at sample {}: {}\n", kind,
               params.value("first_sample", std::uint64_t{0}),
               kind == "skipped" ? fmt::format("{} of {}", params["count"].dump(), params["topic"].dump())
                                 : params.value("text", ""));
  }

  void report() const {
    const Configuration configuration = load_configuration(options_.truth);
    if (configuration.digitizer.kind != DigitizerSettings::Kind::simulated) {
      throw InputError(options_.truth, "/digitizer", "is no simulation: there is no truth to compare with");
    }
    if (!layout_) throw std::runtime_error("the daemon knows no scan");
    const auto errors = compare_with_scene(configuration.digitizer.simulation, *layout_, maps_);
    if (options_.json) {
      fmt::print("{}\n", scene_report_json(errors).dump(2));
    } else {
      fmt::print("{}", scene_report_markdown(errors));
    }
  }

  const WatchOptions& options_;
  InterruptFlag interrupt_;  // also while maps are written
  Client client_;
  MapWriter maps_;
  std::optional<LineOutput> output_;
  std::optional<ScanLayout> layout_;
  Progress progress_;
  bool progress_shown_ = false;
  bool ended_ = false;
  std::uint64_t printed_ = 0, frames_ = 0, pixels_of_frame_ = 0, skipped_ = 0;
};

int run_watch(const WatchOptions& options) {
  Watch watch(options);
  try {
    watch.follow();
  } catch (const std::exception&) {
    watch.write_maps();
    throw;
  }
  watch.finish();
  return exit_done;
}

}  // namespace

void add_watch(CLI::App& app, Command& command) {
  auto options = std::make_shared<WatchOptions>();
  CLI::App* watch = app.add_subcommand("watch", "Follow the daemon: print notifications, collect maps");
  add_connect(*watch, options->connect);
  watch->add_option("--topics", options->topics, "What to print")
      ->delimiter(',')
      ->check(CLI::IsMember({"pixel", "line", "frame", "spectrum", "status", "event"}))
      ->capture_default_str();
  watch->add_option("--fields", options->fields, "Pixels with their tones, or the fit alone")
      ->check(CLI::IsMember({"fit", "all"}))
      ->capture_default_str();
  watch->add_option("--every", options->every, "Every n-th pixel")
      ->check(positive_number())
      ->capture_default_str();
  watch->add_option("--count", options->count, "End after so many lines")->check(positive_number());
  watch->add_option("--frames", options->frames, "End after so many whole frames")->check(positive_number());
  watch->add_flag("--start-scan", options->start_scan, "Start a scan of --frames (or one) once subscribed");
  watch
      ->add_option("--output", options->output,
                   "Lines to this file; - is stdout, the default without maps or truth")
      ->type_name("FILE");
  watch->add_option("--maps", options->maps, "Write maps (GSF) here at the end")->type_name("DIR");
  watch->add_option("--truth", options->truth, "Compare the maps with the scene of this configuration")
      ->type_name("CONFIG");
  watch->add_flag("--json", options->json, "The comparison as JSON instead of Markdown");
  watch->callback([options, &command] { command = [options] { return run_watch(*options); }; });
}

}  // namespace combforce

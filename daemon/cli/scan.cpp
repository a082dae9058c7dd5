// combforce scan start|stop.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "daemon/cli/client.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/exit_code.hpp"
#include "daemon/cli/interrupt_flag.hpp"
#include "daemon/cli/number_checks.hpp"
#include "daemon/cli/progress.hpp"

namespace combforce {

namespace {

struct ScanOptions {
  std::string connect;
  std::uint32_t frames = 1;
  std::uint32_t lines = 0, columns = 0;  // 0: as configured
  bool wait = false;
  bool json = false;
};

// Until `frames` frames are done (0: until the scan ends).
int wait_for_frames(Client& client, std::uint32_t frames) {
  const InterruptFlag interrupt;
  Progress progress;
  std::uint32_t done = 0;
  while (frames == 0 || done < frames) {
    const auto line = client.next(std::chrono::milliseconds(200));
    if (InterruptFlag::raised()) throw std::runtime_error("interrupted; the scan goes on");
    if (!line) continue;
    const Json message = parse_json(*line, "");
    const Json& params = message.at("params");
    const std::string method = message.value("method", "");
    const std::string kind = params.value("kind", "");
    if (method == "frame" && params.value("whole", true)) ++done;
    if (method == "line")
      progress.show(fmt::format("frame {} line {}", params["frame"].dump(), params["line"].dump()));
    if (kind == "scan_ended" || kind == "stream_ended") {
      if (frames == 0 || done >= frames) return exit_done;
      throw std::runtime_error(fmt::format("the scan ended after {} of {} frames", done, frames));
    }
  }
  return exit_done;
}

int run_start(const ScanOptions& options) {
  Client client(options.connect);
  if (options.wait) client.call("subscribe", {{"topics", {"line", "frame", "event"}}});
  Json params{{"frames", options.frames}};
  if (options.lines > 0) params["lines"] = options.lines;
  if (options.columns > 0) params["columns"] = options.columns;
  const Json result = client.call("scan.start", params);
  if (options.json) fmt::print("{}\n", result.dump());
  return options.wait ? wait_for_frames(client, options.frames) : exit_done;
}

int run_stop(const ScanOptions& options) {
  const Json result = Client(options.connect).call("scan.stop");
  if (options.json) fmt::print("{}\n", result.dump());
  return exit_done;
}

}  // namespace

void add_scan(CLI::App& app, Command& command) {
  auto options = std::make_shared<ScanOptions>();
  CLI::App* scan = app.add_subcommand("scan", "Start or stop a scan");
  scan->require_subcommand(1);
  CLI::App* start = scan->add_subcommand("start", "Scan");
  start->add_option("--frames", options->frames, "Frames to scan; 0: until stopped")->capture_default_str();
  start->add_option("--lines", options->lines, "Lines; absent: as configured")->check(positive_number());
  start->add_option("--columns", options->columns, "Pixels a line; absent: as configured")
      ->check(positive_number());
  start->add_flag("--wait", options->wait, "Return when the frames are done");
  start->callback([options, &command] { command = [options] { return run_start(*options); }; });
  CLI::App* stop = scan->add_subcommand("stop", "End the scan");
  stop->callback([options, &command] { command = [options] { return run_stop(*options); }; });
  for (CLI::App* each : {start, stop}) {
    add_connect(*each, options->connect);
    each->add_flag("--json", options->json, "the daemon's answer as JSON");
  }
}

}  // namespace combforce

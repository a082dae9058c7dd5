// combforce record start|stop: record the stream as SigMF.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdint>
#include <memory>
#include <string>

#include "daemon/cli/client.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/exit_code.hpp"

namespace combforce {

namespace {

struct RecordOptions {
  std::string connect, name;
  bool json = false;
};

int run_start(const RecordOptions& options) {
  Client client(options.connect);
  Json params = Json::object();
  if (!options.name.empty()) params["name"] = options.name;
  const Json result = client.call("record.start", params);
  fmt::print("{}\n", options.json ? result.dump() : result.value("meta_path", ""));
  return exit_done;
}

int run_stop(const RecordOptions& options) {
  Client client(options.connect);
  const Json result = client.call("record.stop");
  if (options.json) {
    fmt::print("{}\n", result.dump());
  } else {
    fmt::print("{}: {} frames, {} gaps, {} frames lost\n", result.value("meta_path", ""),
               result.value("frames", std::uint64_t{0}), result.value("gaps", std::uint64_t{0}),
               result.value("lost_frames", std::uint64_t{0}));
  }
  if (result.value("complete", false)) return exit_done;
  fmt::print(stderr, "combforce: the recording is not complete: {}\n", result.value("failure", ""));
  return exit_failed;
}

}  // namespace

void add_record(CLI::App& app, Command& command) {
  auto options = std::make_shared<RecordOptions>();
  CLI::App* record = app.add_subcommand("record", "Record the stream as SigMF");
  record->require_subcommand(1);
  CLI::App* start = record->add_subcommand("start", "Start a recording and print the path of its metadata");
  start->add_option("name", options->name, "Name of the recording; absent: from the time");
  start->callback([options, &command] { command = [options] { return run_start(*options); }; });
  CLI::App* stop = record->add_subcommand("stop", "End the recording");
  stop->callback([options, &command] { command = [options] { return run_stop(*options); }; });
  for (CLI::App* each : {start, stop}) {
    add_connect(*each, options->connect);
    each->add_flag("--json", options->json, "the daemon's answer as JSON");
  }
}

}  // namespace combforce

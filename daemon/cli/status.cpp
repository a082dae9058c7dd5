// combforce status: what the daemon runs and where it stands.
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

struct StatusOptions {
  std::string connect;
  bool json = false;
};

std::string text(const Json& object, const char* key) {
  return object.value(key, "");
}
std::uint64_t count(const Json& object, const char* key) {
  return object.value(key, std::uint64_t{0});
}

std::string recording(const Json& status) {
  const Json& record = status["record"];
  if (record.is_null()) return "none";
  return fmt::format("{} {}, {} frames, {} gaps{}", status["recording"] == true ? "to" : "was",
                     text(record, "meta_path"), count(record, "frames"), count(record, "gaps"),
                     text(record, "failure").empty() ? "" : "; " + text(record, "failure"));
}

void print(const Json& info, const Json& status) {
  fmt::print("{} {}, protocol {}: {} at {:.10g} samples/s\n", text(info, "name"), text(info, "version"),
             count(info, "protocol"), text(info["digitizer"], "name"), info.value("sample_rate_hz", 0.0));
  fmt::print("state      {}{}{}\n", text(status, "state"), status["scanning"] == true ? ", scanning" : "",
             text(status, "reason").empty() ? "" : ": " + text(status, "reason"));
  fmt::print("sample     {} of epoch {}, {} within {} s\n", count(status, "sample"), count(status, "epoch"),
             text(status, "utc"), status["uncertainty_s"].dump());
  fmt::print("speed      {} of real time, extraction busy {}\n", status["realtime_factor"].dump(),
             status["extraction_busy"].dump());
  fmt::print("pixels     {} out, {} not fitted, {} fit workers\n", count(status, "pixels_retired"),
             count(status, "not_fitted"), count(status, "threads"));
  fmt::print("lost       {} frames by the source, {} before extraction, {} before the recorder\n",
             count(status, "lost_frames"), count(status, "dropped_extraction"),
             count(status, "dropped_recorder"));
  fmt::print("recording  {}\n", recording(status));
}

int run_status(const StatusOptions& options) {
  Client client(options.connect);
  const Json info = client.call("instrument.info");
  const Json status = client.call("instrument.status");
  if (options.json) {
    fmt::print("{}\n", Json{{"info", info}, {"status", status}}.dump(2));
  } else {
    print(info, status);
  }
  return exit_done;
}

}  // namespace

void add_status(CLI::App& app, Command& command) {
  auto options = std::make_shared<StatusOptions>();
  CLI::App* status = app.add_subcommand("status", "What the daemon runs and where it stands");
  add_connect(*status, options->connect);
  status->add_flag("--json", options->json, "info and status as JSON");
  status->callback([options, &command] { command = [options] { return run_status(*options); }; });
}

}  // namespace combforce

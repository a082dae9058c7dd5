// combforce free: capture the free motion, the reference from which forces are measured.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <complex>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "daemon/cli/client.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/exit_code.hpp"
#include "proto/description.hpp"

namespace combforce {

namespace {

struct FreeOptions {
  std::string connect;
  std::uint32_t windows = 16;
  bool lifted = false;
  bool json = false;
};

void print(const std::vector<std::complex<double>>& tones_nm, const Comb& comb, double sample_rate_hz) {
  const double spacing_hz = sample_rate_hz / static_cast<double>(comb.window_samples);
  for (std::size_t i = 0; i < tones_nm.size() && i < comb.tones.size(); ++i)
    fmt::print("{:>14.3f} Hz  {:>12.6f} nm  {:>9.6f} rad\n",
               spacing_hz * static_cast<double>(comb.tones[i].bin), std::abs(tones_nm[i]),
               std::arg(tones_nm[i]));
}

void print(const FreeResponse& response, const Comb& comb, double sample_rate_hz) {
  fmt::print("free motion of {} windows from sample {} on\n", response.windows, response.first_sample);
  print(response.mean_nm, comb, sample_rate_hz);
  if (!response.lifted_nm) return;
  fmt::print("lifted just above the surface, {} windows\n", response.lifted_windows);
  print(*response.lifted_nm, comb, sample_rate_hz);
}

int run_free(const FreeOptions& options) {
  Client client(options.connect);
  const Json result = client.call("free.capture", {{"windows", options.windows}, {"lifted", options.lifted}});
  if (options.json) {
    fmt::print("{}\n", result.dump());
    return exit_done;
  }
  const Json info = client.call("instrument.info");
  const std::string source = "free.capture";
  print(decode_free_response(JsonView(result, source), UnknownKeys::allow),
        decode_comb(JsonView(info, source).get("comb"), UnknownKeys::allow),
        info.value("sample_rate_hz", 0.0));
  return exit_done;
}

}  // namespace

void add_free(CLI::App& app, Command& command) {
  auto options = std::make_shared<FreeOptions>();
  CLI::App* free = app.add_subcommand("free", "Capture the free motion: the reference of every force");
  add_connect(*free, options->connect);
  free->add_option("--windows", options->windows, "Comb windows to average")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000000));
  free->add_flag(
      "--lifted", options->lifted,
      "the tip is just above the surface: for fits that remove a background, beside the one far away");
  free->add_flag("--json", options->json, "the daemon's answer as JSON");
  free->callback([options, &command] { command = [options] { return run_free(*options); }; });
}

}  // namespace combforce

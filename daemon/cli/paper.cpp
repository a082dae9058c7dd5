// combforce paper: reproduces the paper from our own simulator and fitter.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <fstream>
#include <memory>
#include <stdexcept>

#include "daemon/cli/commands.hpp"
#include "daemon/cli/exit_code.hpp"
#include "daemon/cli/paper/figures.hpp"
#include "daemon/cli/paper/report.hpp"
#include "daemon/cli/progress.hpp"

namespace combforce {
namespace {

struct PaperOptions {
  std::string output, json;
  std::size_t draws = paper::all_draws;
};

void write_file(const std::filesystem::path& path, const std::string& text) {
  std::ofstream file(path);
  file << text;
  file.close();
  if (!file) throw std::runtime_error(fmt::format("{}: cannot be written", path.string()));
}

int run_paper(const PaperOptions& options) {
  if (!options.output.empty()) std::filesystem::create_directories(options.output);
  if (!options.json.empty()) write_file(options.json, "");  // before minutes of work, not after
  Progress progress;
  const paper::Results results =
      paper::reproduce(options.draws, [&](std::string_view step) { progress.show(step); });
  progress.clear();
  const std::string text = paper::markdown(results);
  fmt::print("{}", text);
  if (!options.json.empty()) write_file(options.json, paper::json(results).dump(2) + "\n");
  if (options.output.empty()) return exit_done;

  const std::filesystem::path directory = options.output;
  write_file(directory / "paper.md", text);
  paper::write_data(directory, results);
  if (paper::draw(directory) == paper::Drawing::no_gnuplot)
    fmt::print(stderr,
               "combforce: gnuplot is not installed: {} has the data and the scripts, but no figures\n",
               directory.string());
  return exit_done;
}

}  // namespace

void add_paper(CLI::App& app, Command& command) {
  auto options = std::make_shared<PaperOptions>();
  CLI::App* paper = app.add_subcommand("paper", "Reproduce Forchheimer et al. 2014: tables, figures");
  paper->add_option("--output", options->output, "directory for paper.md, data files and figures");
  paper->add_option("--json", options->json, "file for the tables as JSON");
  paper->add_option("--draws", options->draws, "draws of the noise a case (the paper: 100)")
      ->check(CLI::Range(std::size_t{2}, paper::all_draws))
      ->capture_default_str();
  paper->callback([options, &command] { command = [options] { return run_paper(*options); }; });
}

}  // namespace combforce

// combforce paper: reproduces the paper from our own simulator and fitter.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <fstream>
#include <memory>
#include <span>
#include <stdexcept>

#include "daemon/cli/commands.hpp"
#include "daemon/cli/exit_code.hpp"
#include "daemon/cli/paper/figures.hpp"
#include "daemon/cli/paper/report.hpp"
#include "daemon/cli/progress.hpp"

namespace combforce {
namespace {

constexpr std::size_t most_pixels = 2000;  // of any case of the coverage study

struct PaperOptions {
  std::string output, json;
  std::size_t draws = paper::all_draws;
  bool beyond = false;
  std::size_t pixels = most_pixels;
};

void write_file(const std::filesystem::path& path, const std::string& text) {
  std::ofstream file(path);
  file << text;
  file.close();
  if (!file) throw std::runtime_error(fmt::format("{}: cannot be written", path.string()));
}

// Prints the study's tables and writes the files asked for; `file`: of the tables in the directory.
template <typename Study>
int report(const PaperOptions& options, const Study& study, const char* file,
           std::span<const paper::Script> scripts) {
  const std::string text = paper::markdown(study);
  fmt::print("{}", text);
  if (!options.json.empty()) write_file(options.json, paper::json(study).dump(2) + "\n");
  if (options.output.empty()) return exit_done;

  const std::filesystem::path directory = options.output;
  write_file(directory / file, text);
  paper::write_data(directory, study);
  if (paper::draw(directory, scripts) == paper::Drawing::no_gnuplot)
    fmt::print(stderr,
               "combforce: gnuplot is not installed: {} has the data and the scripts, but no figures\n",
               directory.string());
  return exit_done;
}

int run_paper(const PaperOptions& options) {
  if (!options.output.empty()) std::filesystem::create_directories(options.output);
  if (!options.json.empty()) write_file(options.json, "");  // before minutes of work, not after
  Progress progress;
  const auto step = [&](std::string_view what) { progress.show(what); };
  if (options.beyond) {
    const paper::Beyond beyond = paper::look_beyond(options.pixels, step);
    progress.clear();
    return report(options, beyond, "beyond.md", paper::beyond_scripts());
  }
  const paper::Results results = paper::reproduce(options.draws, step);
  progress.clear();
  return report(options, results, "paper.md", paper::scripts());
}

}  // namespace

void add_paper(CLI::App& app, Command& command) {
  auto options = std::make_shared<PaperOptions>();
  CLI::App* paper = app.add_subcommand("paper", "Reproduce Forchheimer et al. 2014: tables, figures");
  paper->add_option("--output", options->output,
                    "directory for paper.md or beyond.md, data files and figures");
  paper->add_option("--json", options->json, "file for the tables as JSON");
  CLI::Option* draws =
      paper->add_option("--draws", options->draws, "draws of the noise a case (the paper: 100)");
  draws->check(CLI::Range(std::size_t{2}, paper::all_draws))->capture_default_str();
  CLI::Option* beyond =
      paper->add_flag("--beyond", options->beyond,
                      "instead: the same cases with the bias removed, and whether error bars hold");
  draws->excludes(beyond);
  paper->add_option("--pixels", options->pixels, "pixels drawn a case of the error bars, some cases fewer")
      ->check(CLI::Range(std::size_t{2}, most_pixels))
      ->capture_default_str()
      ->needs(beyond);
  paper->callback([options, &command] { command = [options] { return run_paper(*options); }; });
}

}  // namespace combforce

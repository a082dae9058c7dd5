// combforce: client of combforced and offline tool.
#include <CLI/CLI.hpp>

#include <string>
#include <vector>

#include "daemon/cli/commands.hpp"
#include "daemon/cli/exit_code.hpp"

namespace {

void add_version(CLI::App& app) {
  app.set_version_flag("--version", "combforce " COMBFORCE_VERSION);
  for (CLI::App* sub : app.get_subcommands([](CLI::App*) { return true; })) add_version(*sub);
}

// Where a subcommand was wanted: the word that is none. Empty: none was given.
std::string unknown_subcommand(const CLI::App& app) {
  const std::vector<CLI::App*> chosen = app.get_subcommands();
  if (!chosen.empty()) return unknown_subcommand(*chosen.front());
  const std::vector<std::string> extra = app.remaining();
  return app.get_require_subcommand_min() > 0 && !extra.empty() ? extra.front() : "";
}

int run(int argc, char** argv) {
  CLI::App app{"Forces from multifrequency AFM: offline tool, and client of combforced", "combforce"};
  app.require_subcommand(1);
  combforce::Command command;
  combforce::add_replay(app, command);
  combforce::add_simulate(app, command);
  combforce::add_status(app, command);
  combforce::add_watch(app, command);
  combforce::add_scan(app, command);
  combforce::add_record(app, command);
  combforce::add_free(app, command);
  combforce::add_calibrate(app, command);
  combforce::add_paper(app, command);
  combforce::add_drive(app, command);
  add_version(app);

  try {
    app.parse(argc, argv);
  } catch (const CLI::RequiredError& error) {
    const std::string unknown = unknown_subcommand(app);
    if (unknown.empty())
      app.exit(error);
    else
      app.exit(CLI::ValidationError(unknown, "is no subcommand"));
    return combforce::exit_usage;
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? combforce::exit_done : combforce::exit_usage;
  }
  return command();
}

}  // namespace

int main(int argc, char** argv) {
  return combforce::run_program("combforce", [argc, argv] { return run(argc, argv); });
}

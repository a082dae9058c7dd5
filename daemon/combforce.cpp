// combforce: client of combforced and offline tool.
#include <CLI/CLI.hpp>

#include "daemon/cli/commands.hpp"
#include "daemon/cli/exit_code.hpp"

namespace {

void add_version(CLI::App& app) {
  app.set_version_flag("--version", "combforce " COMBFORCE_VERSION);
  for (CLI::App* sub : app.get_subcommands([](CLI::App*) { return true; })) add_version(*sub);
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
  add_version(app);

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? combforce::exit_done : combforce::exit_usage;
  }
  return command();
}

}  // namespace

int main(int argc, char** argv) {
  return combforce::run_program("combforce", [argc, argv] { return run(argc, argv); });
}

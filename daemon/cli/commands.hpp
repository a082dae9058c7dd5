// The subcommands of `combforce`: one file each. add_…() declares a subcommand with its options; when it is
// chosen, it leaves in `command` what is to be run, and that returns the exit code. Errors are thrown: see
// run_command().
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace combforce {

using Command = std::function<int()>;

// A subcommand keeps its options alive by a shared pointer:
//   auto options = std::make_shared<StatusOptions>();
//   CLI::App* status = app.add_subcommand("status", "…");
//   status->add_option("--connect", options->connect, "…");
//   status->callback([options, &command] { command = [options] { return run_status(*options); }; });

// One line a subcommand, in the order of --help; combforce.cpp calls them.
void add_replay(CLI::App& app, Command& command);
void add_simulate(CLI::App& app, Command& command);
void add_status(CLI::App& app, Command& command);
void add_watch(CLI::App& app, Command& command);
void add_scan(CLI::App& app, Command& command);
void add_record(CLI::App& app, Command& command);
void add_free(CLI::App& app, Command& command);
void add_calibrate(CLI::App& app, Command& command);
void add_paper(CLI::App& app, Command& command);
void add_drive(CLI::App& app, Command& command);

}  // namespace combforce

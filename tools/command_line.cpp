// SPDX-License-Identifier: Apache-2.0
#include "command_line.hpp"

#include <exception>

#include <CLI/CLI.hpp>

#include "config/mistyped.hpp"
#include "locus_replay/failure.hpp"
#include "locus_replay/print_message.hpp"

namespace locus::tools {

bool parse_command_line(CLI::App& app, int argc, char** argv) {
  try {
    app.parse(argc, argv);
    return true;
  } catch (const CLI::Success& asked_for_text) {
    app.exit(asked_for_text);
    return false;
  } catch (const CLI::ParseError& error) {
    throw Failure(ExitStatus::wrong_usage, explain(app, error));
  }
}

int exit_status_of(std::string_view program, const std::function<void()>& work) {
  try {
    work();
    flush_standard_output();
    return static_cast<int>(ExitStatus::done);
  } catch (const Failure& failure) {
    print_message(program, failure.what());
    return static_cast<int>(failure.status());
  } catch (const std::exception& error) { // out of memory or threads
    print_message(program, error.what());
    return static_cast<int>(ExitStatus::failed);
  }
}

} // namespace locus::tools

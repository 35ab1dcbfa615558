// SPDX-License-Identifier: Apache-2.0
#include "command_line.hpp"

#include <CLI/CLI.hpp>

#include "config/mistyped.hpp"
#include "locus_replay/failure.hpp"

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

} // namespace locus::tools

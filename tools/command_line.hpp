// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string_view>

namespace CLI {
class App;
} // namespace CLI

namespace locus::tools {

/// Parses the command line of a program. Returns false if help or version were requested and have been printed. Throws
/// Failure, which names an unknown option and suggests the closest one.
bool parse_command_line(CLI::App& app, int argc, char** argv);

/// Runs the body of a program, reports a failure under the program's name, and returns the exit status.
int exit_status_of(std::string_view program, const std::function<void()>& work);

} // namespace locus::tools

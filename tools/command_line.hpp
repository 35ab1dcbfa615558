// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string_view>

namespace CLI {
class App;
} // namespace CLI

namespace locus::tools {

/// Reads the command line of a program. False where help or version were asked for and have been printed. Throws
/// Failure, which names an option that does not exist and the one that was probably meant.
bool parse_command_line(CLI::App& app, int argc, char** argv);

/// The whole of a program: does the work, says under the program's name why it could not, and gives the exit status.
int exit_status_of(std::string_view program, const std::function<void()>& work);

} // namespace locus::tools

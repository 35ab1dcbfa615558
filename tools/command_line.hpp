// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace CLI {
class App;
} // namespace CLI

namespace locus::tools {

/// Reads the command line of a program. False where help or version were asked for and have been printed. Throws
/// Failure, which names an option that does not exist and the one that was probably meant.
bool parse_command_line(CLI::App& app, int argc, char** argv);

} // namespace locus::tools

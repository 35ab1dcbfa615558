// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace CLI {
class App;
class ParseError;
} // namespace CLI

namespace locus {

/// One line for a user whose command line cannot be read. Names an option or a command that does not exist, and the one
/// that was probably meant. `app` has thrown `error`. Any thread.
std::string explain(const CLI::App& app, const CLI::ParseError& error);

} // namespace locus

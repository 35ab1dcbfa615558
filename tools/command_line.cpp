// SPDX-License-Identifier: Apache-2.0
#include "command_line.hpp"

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <cctype>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "config/nearest_word.hpp"
#include "locus_replay/failure.hpp"

namespace locus::tools {
namespace {

std::vector<std::string> names_of(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_lnames())
      names.push_back("--" + name);
    for (const std::string& name : option->get_snames())
      names.push_back("-" + name);
  }
  return names;
}

/// The first argument that looks like an option and is none.
std::optional<std::string> unknown_option(const CLI::App& app, std::span<char*> arguments) {
  for (const std::string argument : arguments) {
    if (argument == "--")
      break;
    const bool is_option = argument.size() > 1 && argument[0] == '-' &&
                           (argument[1] == '-' || std::isalpha(static_cast<unsigned char>(argument[1])) != 0);
    const std::string name =
        argument.starts_with("--") ? argument.substr(0, argument.find('=')) : argument.substr(0, 2);
    if (is_option && app.get_option_no_throw(name) == nullptr)
      return name;
  }
  return std::nullopt;
}

} // namespace

bool parse_command_line(CLI::App& app, int argc, char** argv) {
  try {
    app.parse(argc, argv);
    return true;
  } catch (const CLI::Success& asked_for_text) {
    app.exit(asked_for_text);
    return false;
  } catch (const CLI::ParseError& error) {
    std::string what = error.what();
    if (const auto unknown = unknown_option(app, std::span(argv, static_cast<std::size_t>(argc)).subspan(1))) {
      const std::vector<std::string> names = names_of(app);
      what = fmt::format("there is no option {}; the nearest is {}", *unknown,
                         nearest_word(*unknown, std::vector<std::string_view>(names.begin(), names.end())));
    }
    throw Failure(ExitStatus::wrong_usage, fmt::format("{}; see {} --help", what, app.get_name()));
  }
}

} // namespace locus::tools

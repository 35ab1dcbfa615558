// SPDX-License-Identifier: Apache-2.0
#include "config/mistyped.hpp"

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <numeric>
#include <string_view>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

namespace locus {

namespace {

/// Returns the Levenshtein distance of a and b.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1); // row[j]: distance from the processed part of a to j letters of b
  std::iota(row.begin(), row.end(), 0);
  for (const char c : a) {
    std::size_t diagonal = row[0]++;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (c == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row.back();
}

} // namespace

std::string_view nearest_word(std::string_view word, std::span<const std::string_view> known) {
  const auto distance = [&](std::string_view candidate) {
    return std::pair{edit_distance(word, candidate.substr(0, word.size())), edit_distance(word, candidate)};
  };
  return *std::min_element(known.begin(), known.end(),
                           [&](std::string_view a, std::string_view b) { return distance(a) < distance(b); });
}

namespace {

std::string nearest(std::string_view word, const std::vector<std::string>& known) {
  return std::string{nearest_word(word, std::vector<std::string_view>(known.begin(), known.end()))};
}

void add_options(const CLI::App& app, std::vector<std::string>& names) {
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_lnames())
      names.push_back("--" + name);
    for (const std::string& name : option->get_snames())
      names.push_back("-" + name);
  }
}

std::vector<std::string> commands_of(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    names.push_back(command->get_name());
  return names;
}

/// Returns the option in an unknown word: without its value, or only the first letter of a group of short options.
std::string option_in(const std::string& word) {
  return word.starts_with("--") ? word.substr(0, word.find('=')) : word.substr(0, 2);
}

bool is_option(std::string_view word) {
  return word.size() > 1 && word[0] == '-' &&
         (word[1] == '-' || std::isalpha(static_cast<unsigned char>(word[1])) != 0);
}

} // namespace

std::string explain(const CLI::App& app, const CLI::ParseError& error) {
  const std::vector<CLI::App*> given = app.get_subcommands();
  std::vector<std::string> options;
  add_options(app, options);
  for (const CLI::App* command : given)
    add_options(*command, options);
  const std::vector<std::string> commands = commands_of(app);
  std::string what = error.what();
  for (const std::string& word : app.remaining(true)) {
    if (is_option(word)) {
      const std::string option = option_in(word);
      what = fmt::format("there is no option {}; the nearest is {}", option, nearest(option, options));
    } else if (given.empty() && !commands.empty()) {
      what = fmt::format("there is no command {}; the nearest is {}", word, nearest(word, commands));
    } else {
      continue;
    }
    break;
  }
  return fmt::format("{}; see {} --help", what, app.get_name());
}

} // namespace locus

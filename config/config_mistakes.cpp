// SPDX-License-Identifier: Apache-2.0
#include "config/config_mistakes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "config/mistyped.hpp"

namespace locus {

std::string join(const std::string& path, std::string_view key) {
  return path.empty() ? std::string{key} : path + '.' + std::string{key};
}

std::vector<std::string> split_at(std::string_view text, char separator) {
  std::vector<std::string> parts{""};
  for (const char c : text)
    c == separator ? void(parts.emplace_back()) : parts.back().push_back(c);
  return parts;
}

std::string unknown_key(std::string_view key, const std::vector<std::string_view>& known) {
  return fmt::format("unknown key; the nearest known one is '{}'", nearest_word(key, known));
}

bool contains(const std::string& outer, const std::string& path) { return (path + '.').starts_with(outer + '.'); }

bool is_blamed(const std::vector<Mistake>& unreadable, const std::string& path) {
  return std::any_of(unreadable.begin(), unreadable.end(), [&](const Mistake& m) { return contains(m.path, path); });
}

std::string path_of(const std::string& problem) { return problem.substr(0, problem.find(": ")); }

std::string text_of(const Mistake& mistake) {
  return mistake.path.empty() ? mistake.what : mistake.path + ": " + mistake.what;
}

std::string error_line(const std::string& where, const std::string& what) {
  std::string line = where + ": " + what;
  std::replace_if(
      line.begin(), line.end(), [](unsigned char c) { return std::iscntrl(c) != 0; }, '?');
  return line;
}

} // namespace locus

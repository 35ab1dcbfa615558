// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

/// Mistakes in a configuration, and the dotted paths of the keys that they name. Internal to config_yaml.hpp. Any
/// thread.
namespace locus {

struct Mistake {
  std::string path; ///< "lidars.0.port"; empty: the whole file
  int line = 0;     ///< starts at 1
  std::string what;
};

/// Appends a key, or the index of a list item, to a path.
std::string join(const std::string& path, std::string_view key);

/// Splits a path into its keys, or a text into its lines; at least one.
std::vector<std::string> split_at(std::string_view text, char separator);

/// Tells whether `path` is `outer` or lies below it.
bool contains(const std::string& outer, const std::string& path);

/// Tells whether `path` or a section around it could not be read.
bool is_blamed(const std::vector<Mistake>& unreadable, const std::string& path);

/// Returns the key of a line of problem().
std::string path_of(const std::string& problem);

/// Describes a key that does not exist; `known` has at least one.
std::string unknown_key(std::string_view key, const std::vector<std::string_view>& known);

/// Formats a mistake without its line: "key: mistake and remedy".
std::string text_of(const Mistake& mistake);

/// Formats one line for the terminal, with control characters of the file replaced.
std::string error_line(const std::string& where, const std::string& what);

} // namespace locus

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdio>
#include <string_view>

#include <fmt/format.h>

namespace locus::tools {

/// Prints errors and warnings to stderr, each line with the program's name, for people and for logs.
inline void print_message(std::string_view program, std::string_view lines) {
  for (std::size_t begin = 0; begin < lines.size();) {
    const std::size_t end = std::min(lines.find('\n', begin), lines.size());
    fmt::print(stderr, "{}: {}\n", program, lines.substr(begin, end - begin));
    begin = end + 1;
  }
}

} // namespace locus::tools

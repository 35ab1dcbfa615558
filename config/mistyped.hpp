// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace CLI {
class App;
class ParseError;
} // namespace CLI

namespace locus {

/// Returns the known word nearest to `word` by edit distance. Truncation counts little: voxel matches voxel_filter.
/// Precondition: `known` is not empty. Any thread.
std::string_view nearest_word(std::string_view word, std::span<const std::string_view> known);

/// Describes an invalid command line in one line for the user: names an unknown option or command and the nearest known
/// one. `error` was thrown by `app`. Any thread.
std::string explain(const CLI::App& app, const CLI::ParseError& error);

} // namespace locus

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

/// The one of the known words that someone most likely meant who wrote `word`: the fewest letters are wrong in it. One
/// that was cut short is near: voxel means voxel_filter. Precondition: some word is known. Any thread.
std::string_view nearest_word(std::string_view word, std::span<const std::string_view> known);

/// One line for a user whose command line cannot be read. Names an option or a command that does not exist, and the one
/// that was probably meant. `app` has thrown `error`. Any thread.
std::string explain(const CLI::App& app, const CLI::ParseError& error);

} // namespace locus

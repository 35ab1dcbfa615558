// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string_view>

namespace locus {

/// The one of the known words that someone most likely meant who wrote `word`: the fewest letters are wrong in it. One
/// that was cut short is near: voxel means voxel_filter. Precondition: some word is known. Any thread.
std::string_view nearest_word(std::string_view word, std::span<const std::string_view> known);

} // namespace locus

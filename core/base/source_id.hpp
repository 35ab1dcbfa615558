// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

namespace locus {

/// A motion source: its place in the configuration, from 0, the first of the highest priority. Where there may be none,
/// it is a std::optional<SourceId>.
enum class SourceId : std::size_t {};

constexpr std::size_t index_of(SourceId source) { return static_cast<std::size_t>(source); }

} // namespace locus

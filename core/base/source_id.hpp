// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

namespace locus {

/// Motion source: its index in the configuration, from 0 in order of falling priority. A std::optional<SourceId> where
/// there may be none.
enum class SourceId : std::size_t {};

constexpr std::size_t index_of(SourceId source) { return static_cast<std::size_t>(source); }

} // namespace locus

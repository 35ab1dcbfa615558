// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

namespace locus::daemon {

/// What one thread writes and another reads is kept this far from everything else, or each write would take the
/// neighbours from the other's cache. The standard's constant for it may differ from compiler to compiler.
inline constexpr std::size_t kCacheLineBytes = 64;

} // namespace locus::daemon

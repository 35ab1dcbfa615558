// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

namespace locus::daemon {

/// How often this executable has asked operator new for memory so far, on all its threads; nothing in a build with
/// a sanitizer, which has an operator new of its own.
std::optional<std::uint64_t> allocations();

} // namespace locus::daemon

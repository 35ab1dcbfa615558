// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

namespace locus::daemon {

/// Returns the number of calls of operator new in this executable so far, on all threads; nothing in sanitizer builds,
/// which have their own operator new.
std::optional<std::uint64_t> allocations();

} // namespace locus::daemon

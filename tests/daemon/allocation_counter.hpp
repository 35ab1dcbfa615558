// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace locus::daemon {

/// How often this executable has asked operator new for memory so far, on all its threads.
std::uint64_t allocations();

} // namespace locus::daemon

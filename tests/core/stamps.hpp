// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/base/stamp.hpp"

namespace locus {

/// Time on a computer that booted one second earlier.
constexpr Stamp at_ms(int ms) { return stamp_from_ns(1'000'000'000) + std::chrono::milliseconds{ms}; }

} // namespace locus

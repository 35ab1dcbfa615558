// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/base/stamp.hpp"

namespace locus {

/// A time on a computer that started a second before.
constexpr Stamp at_ms(int ms) { return stamp_from_ns(1'000'000'000) + std::chrono::milliseconds{ms}; }

} // namespace locus

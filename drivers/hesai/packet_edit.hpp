// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

#include "core/base/stamp.hpp"

namespace locus::hesai {

/// See locus::shift_clock(). False for a packet that is none of a model that can be read. A date that is none stays.
bool shift_clock(std::span<std::byte> packet, Duration shift);

/// See locus::lengthen_ranges(). False as above.
bool lengthen_ranges(std::span<std::byte> packet, double more_m);

} // namespace locus::hesai

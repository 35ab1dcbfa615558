// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

#include "core/base/stamp.hpp"

namespace locus::hesai {

/// Implements locus::shift_clock(). Returns false if the model is not supported. Leaves an invalid date unchanged.
bool shift_clock(std::span<std::byte> packet, Duration shift);

/// Implements locus::lengthen_ranges(). Returns false as above.
bool lengthen_ranges(std::span<std::byte> packet, double more_m);

/// Implements locus::narrow_view(). Returns false as above.
bool narrow_view(std::span<std::byte> packet, double view_deg);

} // namespace locus::hesai

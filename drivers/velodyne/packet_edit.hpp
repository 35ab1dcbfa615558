// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

#include "core/base/stamp.hpp"

namespace locus::velodyne {

/// Implements locus::shift_clock(). Leaves a time beyond the hour, which is invalid, unchanged.
void shift_clock(std::span<std::byte> packet, Duration shift);

/// Implements locus::lengthen_ranges() for packets with a known product ID.
void lengthen_ranges(std::span<std::byte> packet, double more_m);

/// Implements locus::narrow_view().
void narrow_view(std::span<std::byte> packet, double view_deg);

} // namespace locus::velodyne

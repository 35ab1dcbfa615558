// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

#include "core/base/stamp.hpp"

namespace locus::velodyne {

/// See locus::shift_clock(). A time past the hour is none, and stays.
void shift_clock(std::span<std::byte> packet, Duration shift);

/// See locus::lengthen_ranges(). Of a packet whose product id is known.
void lengthen_ranges(std::span<std::byte> packet, double more_m);

} // namespace locus::velodyne

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

#include "core/base/stamp.hpp"
#include "drivers/ouster/metadata.hpp"

namespace locus::ouster {

/// See locus::shift_clock(). In packets of columns, the valid ones, and in those of the inertial unit.
void shift_clock(const Metadata& metadata, std::span<std::byte> packet, Duration shift);

/// See locus::lengthen_ranges().
void lengthen_ranges(const Metadata& metadata, std::span<std::byte> packet, double more_m);

/// In a packet of the inertial unit: adds to its turn about z, in its own frame. Other packets stay as they are.
void add_turn(const Metadata& metadata, std::span<std::byte> packet, double more_radps);

/// The same: makes all its readings NaN.
void make_nan(const Metadata& metadata, std::span<std::byte> packet);

} // namespace locus::ouster

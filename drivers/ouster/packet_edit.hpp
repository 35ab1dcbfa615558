// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

#include "core/base/stamp.hpp"
#include "drivers/ouster/metadata.hpp"

namespace locus::ouster {

/// Implements locus::shift_clock() for the valid columns of lidar packets, and for IMU packets.
void shift_clock(const Metadata& metadata, std::span<std::byte> packet, Duration shift);

/// Implements locus::lengthen_ranges().
void lengthen_ranges(const Metadata& metadata, std::span<std::byte> packet, double more_m);

/// Implements locus::narrow_view(). The x axis is that of the sensor frame.
void narrow_view(const Metadata& metadata, std::span<std::byte> packet, double view_deg);

/// Adds `more_radps` to the angular velocity about z of an IMU packet, IMU frame. Leaves other packets unchanged.
void add_turn(const Metadata& metadata, std::span<std::byte> packet, double more_radps);

/// Sets all values of an IMU packet to NaN. Leaves other packets unchanged.
void make_nan(const Metadata& metadata, std::span<std::byte> packet);

} // namespace locus::ouster

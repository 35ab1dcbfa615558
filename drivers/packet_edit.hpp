// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

#include "core/base/stamp.hpp"
#include "drivers/ouster/metadata.hpp"

namespace locus {

/// Edits packets as if the lidar had measured or stamped differently: for fault injection, and for playing recordings
/// at another time. `ouster` is the metadata of an Ouster, or nullptr for a lidar of another maker, whose packets are
/// recognised by their content. Packets of no known lidar are left unchanged. Correct checksums are updated.
/// Thread-safe.

/// Advances the lidar's clock in a packet of any kind. A Velodyne's clock holds only minutes and seconds, so a whole
/// hour has no effect, and the GPS sentence in its position packet keeps its time; an Ouster's holds nanoseconds since
/// an arbitrary epoch; a Hesai's holds date and microseconds. No clock goes below its zero.
void shift_clock(std::span<std::byte> packet, const ouster::Metadata* ouster, Duration shift);

/// Lengthens the ranges of a data packet by `more_m`, up to the largest that its fields can hold. Adds no returns.
void lengthen_ranges(std::span<std::byte> packet, const ouster::Metadata* ouster, double more_m);

/// Removes the returns of all columns of a data packet that are more than half of `view_deg` away from the lidar's x
/// axis. Leaves azimuths and times unchanged.
void narrow_view(std::span<std::byte> packet, const ouster::Metadata* ouster, double view_deg);

} // namespace locus

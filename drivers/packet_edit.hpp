// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

#include "core/base/stamp.hpp"
#include "drivers/ouster/metadata.hpp"

namespace locus {

/// Changes of a packet, as if its lidar had measured or stamped otherwise: for faults that are injected, and for
/// recordings that are played at another time. `ouster` is the metadata of an Ouster, nullptr for a lidar of another
/// maker, whose packets are told by their looks. A packet of no lidar stays as it is. Checksums that were right are
/// right again. Any thread.

/// Sets the lidar's own clock forward, in a packet of any kind: that of a Velodyne shows minutes and seconds alone, so
/// an hour makes no difference, and the sentence of the GPS in its position packet keeps its time; an Ouster's shows
/// nanoseconds since whenever; a Hesai's shows date and microseconds. None shows anything before its zero.
void shift_clock(std::span<std::byte> packet, const ouster::Metadata* ouster, Duration shift);

/// Of a data packet, as far as it has room for the longer range; where there was no return there still is none.
void lengthen_ranges(std::span<std::byte> packet, const ouster::Metadata* ouster, double more_m);

} // namespace locus

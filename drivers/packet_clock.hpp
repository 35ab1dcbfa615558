// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "core/base/stamp.hpp"
#include "drivers/ouster/metadata.hpp"

namespace locus {

/// Returns the time of a data packet by the lidar's own clock without decoding it, modulo one hour: [0, 1 h). Nothing
/// for packets of other kinds. `ouster` as for shift_clock(). Thread-safe.
std::optional<Duration> clock_in(std::span<const std::byte> packet, const ouster::Metadata* ouster);

/// Returns by how much such a clock advanced between two packets: [-30 min, 30 min).
Duration clock_advance(Duration earlier, Duration later);

} // namespace locus

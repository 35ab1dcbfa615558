// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "core/base/names.hpp"
#include "core/base/stamp.hpp"

namespace locus {

/// What the clock of a sensor whose packets tell the date counts from: its own start or whatever it was left at, or the
/// epoch, in UTC or in TAI (as PTP has it, 37 s ahead).
enum class TimeScale : std::uint8_t { free_running, utc, tai };
constexpr auto names_of(TimeScale) { return std::to_array<std::string_view>({"internal", "UTC", "TAI"}); }

/// TAI - UTC, since 2017.
inline constexpr Duration kTaiAheadOfUtc = std::chrono::seconds{37};

/// Tells the scale of a time of the sensor by the arrival of its packet: whatever the sensor is set to, its clock
/// follows a master only once it has found one. A clock of the host that is wrong by more than 18 s makes it look
/// free-running, but for a time of a sensor that is set to PTP that is none since its start: that is TAI.
TimeScale scale_of(bool is_set_to_ptp, Duration sensor_time, Stamp receive);

/// The sensor's time, on UTC where its scale is known, past the hour: 0 <= it < 1 h. Precondition: sensor_time >= 0.
Duration time_of_hour(Duration sensor_time, TimeScale scale);

} // namespace locus

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "core/base/names.hpp"
#include "core/base/stamp.hpp"

namespace locus {

/// Time scale of a sensor whose packets carry the date: since its own start or an arbitrary epoch, UTC, or TAI (as in
/// PTP, 37 s ahead of UTC).
enum class TimeScale : std::uint8_t { free_running, utc, tai };
constexpr auto names_of(TimeScale) { return std::to_array<std::string_view>({"internal", "UTC", "TAI"}); }

/// TAI - UTC since 2017.
inline constexpr Duration kTaiAheadOfUtc = std::chrono::seconds{37};

/// Determines the time scale of a sensor's time from the arrival of its packet: whatever the setting, the sensor's
/// clock follows a master only once it has found one. A host clock that is off by more than 18 s makes the sensor look
/// free-running, except a sensor set to PTP whose time is too large to be time since start-up: that is TAI.
TimeScale scale_of(bool is_set_to_ptp, Duration sensor_time, Stamp receive);

/// Returns the sensor's time past the hour, in UTC if its scale is known: [0, 1 h). Precondition: sensor_time >= 0.
Duration time_of_hour(Duration sensor_time, TimeScale scale);

} // namespace locus

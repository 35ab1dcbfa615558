// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "core/base/names.hpp"

namespace locus {

/// Where the times of points come from (key: point_times). `automatic` (key: auto): the message's own field where it is
/// sound, else azimuth for what turns, else none. `azimuth`: the share of the turn since the first point. `none`: all
/// points are of one instant, that of the header.
enum class PointTimesFrom : std::uint8_t { automatic, azimuth, none };
constexpr auto names_of(PointTimesFrom) { return std::to_array<std::string_view>({"auto", "azimuth", "none"}); }

/// What is wrong with the times in the clouds of a lidar. The first four leave points without times of their own, the
/// others put all of them elsewhere.
enum class CloudDoubt : std::uint8_t {
  no_times,     ///< no field of them
  equal_times,  ///< all the same
  disorder,     ///< up and down along a ring
  no_unit,      ///< in no unit those of a turn
  stamp_at_end, ///< the header's stamp is that of the last point, and the times count from it as if of the first
  tai,          ///< stamps are 37 s ahead: TAI, not UTC
  ahead,        ///< stamps are ahead of the host's clock
  behind,       ///< stamps are behind it
};
constexpr auto names_of(CloudDoubt) {
  return std::to_array<std::string_view>(
      {"no_times", "equal_times", "disorder", "no_unit", "stamp_at_end", "tai", "ahead", "behind"});
}
inline constexpr std::size_t kCloudDoubts = names_of(CloudDoubt{}).size();
using CloudDoubts = std::bitset<kCloudDoubts>;

/// Where the times of the points of the latest cloud came from.
enum class PointTiming : std::uint8_t { field, azimuth, instant };
constexpr auto names_of(PointTiming) { return std::to_array<std::string_view>({"field", "azimuth", "instant"}); }

/// One line for the user: what is wrong, what is done about it, and what to do.
std::string explain(CloudDoubt doubt, PointTiming timing);

} // namespace locus

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

/// Source of point times (key: point_times). `automatic` (key: auto): the message's own field if it is valid, otherwise
/// azimuth if the points rotate, otherwise none. `azimuth`: the rotation since the first point. `none`: all points at
/// the instant of the header's stamp, the last one exactly.
enum class PointTimesFrom : std::uint8_t { automatic, azimuth, none };
constexpr auto names_of(PointTimesFrom) { return std::to_array<std::string_view>({"auto", "azimuth", "none"}); }

/// Problem with a lidar's clouds, mostly with their times. With the first four, the points' own times are not used; the
/// next four shift the whole cloud in time.
enum class CloudDoubt : std::uint8_t {
  no_times,     ///< no time field
  equal_times,  ///< all times equal
  disorder,     ///< times not monotonic along a ring
  no_unit,      ///< no unit makes the span that of a turn
  stamp_at_end, ///< the header's stamp is the last point's, but the times count as if from the first
  tai,          ///< stamps are 37 s ahead: TAI, not UTC
  ahead,        ///< stamps are ahead of the host's clock
  behind,       ///< stamps are behind the host's clock
  two_frames,   ///< clouds of two frames on one topic
  backwards,    ///< stamps go back or stand still from one cloud to the next
};
constexpr auto names_of(CloudDoubt) {
  return std::to_array<std::string_view>({"no_times", "equal_times", "disorder", "no_unit", "stamp_at_end", "tai",
                                          "ahead", "behind", "two_frames", "backwards"});
}
inline constexpr std::size_t kCloudDoubts = names_of(CloudDoubt{}).size();
using CloudDoubts = std::bitset<kCloudDoubts>;

/// Source of the point times of the latest cloud.
enum class PointTiming : std::uint8_t { field, azimuth, instant };
constexpr auto names_of(PointTiming) { return std::to_array<std::string_view>({"field", "azimuth", "instant"}); }

/// Returns one line for the user: the problem, its consequence, and the remedy.
std::string explain(CloudDoubt doubt, PointTiming timing);

} // namespace locus

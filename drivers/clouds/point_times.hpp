// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "core/base/expected.hpp"
#include "core/base/stamp.hpp"
#include "drivers/clouds/cloud_doubt.hpp"

namespace locus {

/// The longest and shortest that the points of a cloud may take: a turn at 4 Hz, one packet.
inline constexpr Duration kLongestCloud = std::chrono::milliseconds{250};
inline constexpr Duration kShortestCloud = std::chrono::microseconds{500};

/// What the numbers in the time field of a cloud mean.
///
/// The unit is that of s, ms, us and ns in which the points take as long as a lidar's turn does: between the shortest
/// and the longest turn are fewer than three decades, so no two fit. A unit that is known from other clouds of the
/// lidar stays, for a cloud with few columns is shorter, unless it makes this one longer than any. Numbers within a
/// minute of 0 count from the header's stamp, before it if they are negative; others are times of a clock.
struct PointTimes {
  double unit_s = 1.0;
  bool of_a_clock = false;
  double first = 0, last = 0; ///< lowest and highest number

  static PointTimes in_unit(double unit_s, double first, double last);

  /// Whether the points take no longer than those of a cloud may.
  [[nodiscard]] bool is_short_enough() const;

  /// Between two numbers.
  [[nodiscard]] Duration between(double from, double to) const { return from_seconds((to - from) * unit_s); }

  /// The instant of the first point. The clock of the points is believed where it is the header's or, within a second,
  /// that of arrival; else the header's stamp is that of the first point.
  [[nodiscard]] Stamp begin(Stamp header, Stamp arrival) const;
};

/// The numbers of a cloud, in the order of its points, and the rings of these (all 0 where there are none).
/// Precondition: all are finite, both spans as long. Fails with the reason why they are no times.
///
/// They are not where they are all the same, where no unit makes a turn of them, and where along a ring they go up and
/// down: as many as one step in ten both ways.
Expected<PointTimes, CloudDoubt> understand(std::span<const double> times, std::span<const std::uint8_t> rings,
                                            std::optional<double> known_unit_s = std::nullopt);

} // namespace locus

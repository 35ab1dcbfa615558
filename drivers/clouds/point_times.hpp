// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "core/base/expected.hpp"
#include "core/base/stamp.hpp"
#include "drivers/clouds/cloud_doubt.hpp"

namespace locus {

/// Limits for the time span of a cloud: a turn at 4 Hz, one packet.
inline constexpr Duration kLongestCloud = std::chrono::milliseconds{250};
inline constexpr Duration kShortestCloud = std::chrono::microseconds{500};

/// Interpretation of the numbers in a cloud's time field.
///
/// The unit is the one of s, ms, us and ns in which the span of the points is that of a lidar's turn. It is unique,
/// since the shortest and the longest turn differ by fewer than three decades. A unit known from other clouds of the
/// lidar is retained, since a cloud with few columns spans less, unless it makes the span too long. Numbers within a
/// second of 0 are relative to the header's stamp (negative: before it); others are absolute times of a clock.
struct PointTimes {
  double unit_s = 1.0;
  bool of_a_clock = false;
  double first = 0, last = 0; ///< lowest and highest number

  static PointTimes in_unit(double unit_s, double first, double last);

  /// Returns true if the span does not exceed kLongestCloud.
  [[nodiscard]] bool is_short_enough() const;

  /// Time between two numbers.
  [[nodiscard]] Duration between(double from, double to) const { return from_seconds((to - from) * unit_s); }

  /// Returns the instant of the first point by absolute times that agree within a second with the header's stamp or the
  /// arrival; nothing for relative times and for those of another clock.
  [[nodiscard]] std::optional<Stamp> begin_by_clock(Stamp header, Stamp arrival) const;
  /// Returns the instant of the first point relative to the header's stamp, which it is for times of another clock.
  [[nodiscard]] Stamp begin_by_header(Stamp header) const { return of_a_clock ? header : header + between(0, first); }
};

/// Interprets the times of a cloud in the order of its points, with their rings (all 0 if unknown). Precondition: all
/// times are finite, both spans have the same length.
///
/// Fails with the reason if the times are invalid: all equal, no unit that makes the span a turn, or not monotonic
/// along a ring (more than one step in ten each way).
Expected<PointTimes, CloudDoubt> understand(std::span<const double> times, std::span<const std::uint8_t> rings,
                                            std::optional<double> known_unit_s = std::nullopt);

} // namespace locus

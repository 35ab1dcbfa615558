// SPDX-License-Identifier: Apache-2.0
#include "drivers/clouds/point_times.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace locus {

namespace {

constexpr Duration kSameClock = std::chrono::seconds{1};

/// Returns true if the times are not monotonic along the rings.
bool is_disordered(std::span<const double> times, std::span<const std::uint8_t> rings) {
  constexpr std::size_t kOneIn = 10;
  std::array<double, 256> last;
  last.fill(std::nan(""));
  std::size_t up = 0, down = 0;
  for (std::size_t i = 0; i < times.size(); ++i) {
    double& before = last[rings[i]];
    up += times[i] > before ? 1U : 0U;
    down += times[i] < before ? 1U : 0U;
    before = times[i];
  }
  return kOneIn * std::min(up, down) > times.size();
}

/// Finds the unit in which the points span a turn, coarsest first. The lower limit for seconds is one firing, because a
/// finer unit would make the span even shorter; for nanoseconds it is kLongestCloud / 1000, because a shorter span fits
/// microseconds.
std::optional<double> guess_unit_s(double span) {
  struct Unit {
    double unit_s;
    Duration shortest;
  };
  constexpr Duration kFiring = std::chrono::microseconds{10};
  constexpr std::array kUnits{Unit{1.0, kFiring}, Unit{1e-3, kShortestCloud}, Unit{1e-6, kShortestCloud},
                              Unit{1e-9, kLongestCloud / 1000}};
  const auto fits = [span](const Unit& unit) {
    const double span_s = span * unit.unit_s;
    return span_s >= to_seconds(unit.shortest) && span_s <= to_seconds(kLongestCloud);
  };
  const auto found = std::ranges::find_if(kUnits, fits);
  return found == kUnits.end() ? std::nullopt : std::optional{found->unit_s};
}

} // namespace

PointTimes PointTimes::in_unit(double unit_s, double first, double last) {
  const double farthest_s = std::max(std::abs(first), std::abs(last)) * unit_s;
  return {unit_s, farthest_s > to_seconds(kSameClock), first, last};
}

bool PointTimes::is_short_enough() const { return (last - first) * unit_s <= to_seconds(kLongestCloud); }

std::optional<Stamp> PointTimes::begin_by_clock(Stamp header, Stamp arrival) const {
  constexpr double kMost_ns = 9e18;
  const double ns = first * (unit_s * 1e9);
  if (!of_a_clock || !(std::abs(ns) < kMost_ns))
    return std::nullopt;
  const auto is_near = [ns](Stamp other) {
    return std::abs(ns - static_cast<double>(to_ns(other))) < static_cast<double>(kSameClock.count());
  };
  return is_near(header) || is_near(arrival) ? std::optional{stamp_from_ns(std::llround(ns))} : std::nullopt;
}

Expected<PointTimes, CloudDoubt> understand(std::span<const double> times, std::span<const std::uint8_t> rings,
                                            std::optional<double> known_unit_s) {
  const auto [first, last] = std::ranges::minmax(times);
  if (!(last > first))
    return CloudDoubt::equal_times;
  const bool fits_known = known_unit_s && PointTimes::in_unit(*known_unit_s, first, last).is_short_enough();
  const std::optional<double> unit_s = fits_known ? known_unit_s : guess_unit_s(last - first);
  if (!unit_s)
    return CloudDoubt::no_unit;
  if (is_disordered(times, rings))
    return CloudDoubt::disorder;
  return PointTimes::in_unit(*unit_s, first, last);
}

} // namespace locus

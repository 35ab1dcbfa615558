// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "core/base/names.hpp"

namespace locus {

/// Reason why a cloud was rejected. Each has a counter in CloudCounters::refused.
enum class CloudError : std::uint8_t {
  cut,       ///< truncated, or less data than width, height and steps require
  fields,    ///< no x, y, z of float32 or float64, or one outside the point record
  too_large, ///< more points than the decoder's memory holds
  duplicate, ///< cloud received before
  frame,     ///< frame of another lidar on the same topic
  clock,     ///< stamps differ from the host's clock by an offset not yet known
};
constexpr auto names_of(CloudError) {
  return std::to_array<std::string_view>({"cut", "fields", "too_large", "duplicate", "frame", "clock"});
}
inline constexpr std::size_t kCloudErrors = names_of(CloudError{}).size();

/// Counters of the clouds of one lidar: received = used + sum of refused. Points of the used clouds: points = returns +
/// nan + origin + untimed.
struct CloudCounters {
  std::uint64_t received = 0;
  std::uint64_t used = 0;
  std::uint64_t reordered = 0;   ///< received after a later one; included in `used`
  std::uint64_t clock_steps = 0; ///< steps of the stamps relative to the host's clock
  std::array<std::uint64_t, kCloudErrors> refused{};
  std::uint64_t points = 0;
  std::uint64_t nan = 0;     ///< points with a coordinate that is not finite
  std::uint64_t origin = 0;  ///< points at 0, 0, 0: no return
  std::uint64_t untimed = 0; ///< points with a time that is not finite

  std::uint64_t& operator[](CloudError error) { return refused[static_cast<std::size_t>(error)]; }
  std::uint64_t operator[](CloudError error) const { return refused[static_cast<std::size_t>(error)]; }

  bool operator==(const CloudCounters&) const = default;
};

} // namespace locus

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "core/base/names.hpp"

namespace locus {

/// Why a cloud was not used. Each has its counter in CloudCounters::refused.
enum class CloudError : std::uint8_t {
  cut,        ///< breaks off, or has fewer bytes than width, height and steps ask for
  fields,     ///< no x, y, z of float32 or float64, or one that lies outside a point's bytes
  big_endian, ///< numbers in an order of bytes that no lidar's driver writes
  too_large,  ///< more points than a decoder has memory for
  duplicate,  ///< was there already
  clock,      ///< its stamps and the host's clock differ, and it is not known yet by how much
};
constexpr auto names_of(CloudError) {
  return std::to_array<std::string_view>({"cut", "fields", "big_endian", "too_large", "duplicate", "clock"});
}
inline constexpr std::size_t kCloudErrors = names_of(CloudError{}).size();

/// What became of the clouds of one lidar: received = used + the sum of refused; and of the points of those used:
/// points = returns + nan + origin + untimed.
struct CloudCounters {
  std::uint64_t received = 0;
  std::uint64_t used = 0;
  std::uint64_t reordered = 0;   ///< came after a later one; among those used
  std::uint64_t clock_steps = 0; ///< of the stamps against the host's clock
  std::array<std::uint64_t, kCloudErrors> refused{};
  std::uint64_t points = 0;
  std::uint64_t nan = 0;     ///< a coordinate that is no finite number
  std::uint64_t origin = 0;  ///< 0, 0, 0: where nothing returned
  std::uint64_t untimed = 0; ///< a time that is no finite number

  std::uint64_t& operator[](CloudError error) { return refused[static_cast<std::size_t>(error)]; }
  std::uint64_t operator[](CloudError error) const { return refused[static_cast<std::size_t>(error)]; }

  bool operator==(const CloudCounters&) const = default;
};

} // namespace locus

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>

#include "core/base/expected.hpp"
#include "drivers/clouds/cloud_counters.hpp"
#include "drivers/clouds/cloud_view.hpp"

namespace locus {

/// Layout of a point record. Fields are identified by name, whatever the driver:
///
/// | driver | ring | time |
/// |---|---|---|
/// | velodyne_pointcloud | ring: uint16 | time: float32, s relative to the header's stamp, of either sign |
/// | ouster-ros | ring: uint8 or uint16 | t: uint32, ns since the header's stamp |
/// | Hesai, RoboSense | ring: uint16 | timestamp: float64, s since 1970 |
/// | nebula | channel: uint16 | time_stamp: uint32, ns since the header's stamp |
/// | livox_ros_driver | line: uint8 | timestamp: float64, ns since 1970; offset_time: uint32, ns |
///
/// Units and epochs of the times are inferred from their values, see PointTimes.
struct CloudLayout {
  using Type = CloudView::Type;
  struct Column {
    std::uint32_t offset = 0;
    Type type{};
    bool operator==(const Column&) const = default;
  };

  Column x, y, z;
  std::optional<Column> intensity, ring, time;
  bool row_is_ring = false; ///< organised cloud: each row is a laser, and there is no ring field

  bool operator==(const CloudLayout&) const = default;
};

/// Determines the layout of a message. Fails with the reason for rejection; the message must then not be read.
/// Thread-safe.
Expected<CloudLayout, CloudError> layout_of(const CloudView& message);

/// Limit for the points of a message: twice the largest lidar of today in dual return mode.
inline constexpr std::size_t kMaxCloudPoints = std::size_t{1} << 20;

inline std::size_t points_of(const CloudView& message) { return std::size_t{message.height} * message.width; }

/// Calls `visit(value)` with each point's value in one column, in the order of the message. Precondition: `column`
/// belongs to the layout that layout_of() returned for this message.
template <class Visit> void for_each_in(const CloudView& message, CloudLayout::Column column, const Visit& visit) {
  const auto visit_each = [&](const auto& visit_bytes) {
    if (message.width == 0)
      return;
    for (std::size_t row = 0; row < message.height; ++row) {
      const std::byte* at = message.data.data() + row * message.row_step + column.offset;
      for (std::size_t i = 0; i < message.width; ++i, at += message.point_step)
        visit_bytes(at);
    }
  };
  const auto read_as = [&]<class Number>(Number value) {
    if (!message.is_big_endian)
      return visit_each([&](const std::byte* at) {
        std::memcpy(&value, at, sizeof(value));
        visit(value);
      });
    visit_each([&](const std::byte* at) {
      std::array<std::byte, sizeof(value)> bytes;
      std::reverse_copy(at, at + sizeof(value), bytes.begin());
      std::memcpy(&value, bytes.data(), sizeof(value));
      visit(value);
    });
  };
  using Type = CloudView::Type;
  switch (column.type) {
  case Type::int8:
    return read_as(std::int8_t{});
  case Type::uint8:
    return read_as(std::uint8_t{});
  case Type::int16:
    return read_as(std::int16_t{});
  case Type::uint16:
    return read_as(std::uint16_t{});
  case Type::int32:
    return read_as(std::int32_t{});
  case Type::uint32:
    return read_as(std::uint32_t{});
  case Type::float32:
    return read_as(float{});
  case Type::float64:
    return read_as(double{});
  }
}

} // namespace locus

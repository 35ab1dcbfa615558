// SPDX-License-Identifier: Apache-2.0
#include "drivers/clouds/cloud_layout.hpp"

#include <algorithm>
#include <array>
#include <string_view>

#include "core/ingest/lidar_packet.hpp"

namespace locus {

namespace {

using Type = CloudView::Type;
using Column = CloudLayout::Column;

/// Size of a number in bytes; 0 for an invalid type.
std::size_t bytes_of(Type type) {
  constexpr std::array<std::size_t, 9> kBytes{0, 1, 1, 2, 2, 4, 4, 4, 8};
  const auto index = static_cast<std::size_t>(type);
  return index < kBytes.size() ? kBytes[index] : 0;
}

bool is_real(Column column) { return column.type == Type::float32 || column.type == Type::float64; }

/// Finds the first of these names that exists as a valid field.
std::optional<Column> find(const CloudView& message, std::span<const std::string_view> names) {
  for (const std::string_view name : names) {
    const auto field = std::ranges::find(message.fields(), name, &CloudView::Field::name);
    if (field == message.fields().end())
      continue;
    const std::size_t bytes = bytes_of(field->type);
    if (bytes > 0 && field->offset + bytes <= message.point_step)
      return Column{field->offset, field->type};
  }
  return std::nullopt;
}

std::optional<Column> coordinate(const CloudView& message, std::string_view name) {
  const std::optional<Column> column = find(message, std::span{&name, 1});
  return column && is_real(*column) ? column : std::nullopt;
}

/// Returns true if all points lie within the data; the last one need not be padded to its step.
bool is_whole(const CloudView& message, const CloudLayout& layout) {
  if (points_of(message) == 0)
    return true;
  std::size_t end = 0;
  for (const std::optional<Column>& column : {std::optional{layout.x}, std::optional{layout.y}, std::optional{layout.z},
                                              layout.intensity, layout.ring, layout.time}) {
    if (column)
      end = std::max(end, column->offset + bytes_of(column->type));
  }
  const std::size_t row = std::size_t{message.width - 1} * message.point_step + end;
  return (message.height == 1 || message.row_step >= std::size_t{message.width} * message.point_step) &&
         std::size_t{message.height - 1} * message.row_step + row <= message.data.size();
}

} // namespace

Expected<CloudLayout, CloudError> layout_of(const CloudView& message) {
  constexpr std::array<std::string_view, 3> kIntensities{"intensity", "reflectivity", "i"};
  constexpr std::array<std::string_view, 3> kRings{"ring", "channel", "line"};
  constexpr std::array<std::string_view, 6> kTimes{"time",       "t",           "timestamp",
                                                   "time_stamp", "offset_time", "time_offset"};
  constexpr std::uint32_t kFewestRows = 4;
  const auto x = coordinate(message, "x"), y = coordinate(message, "y"), z = coordinate(message, "z");
  if (!x || !y || !z)
    return CloudError::fields;
  CloudLayout layout{*x, *y, *z, find(message, kIntensities), find(message, kRings), find(message, kTimes)};
  layout.row_is_ring = !layout.ring && message.height >= kFewestRows && message.height <= LidarPacket::kMaxLasers &&
                       message.width > message.height;
  if (points_of(message) > kMaxCloudPoints)
    return CloudError::too_large;
  if (!is_whole(message, layout))
    return CloudError::cut;
  return layout;
}

} // namespace locus

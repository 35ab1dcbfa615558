// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "core/base/stamp.hpp"
#include "drivers/clouds/message_reader.hpp"

namespace locus {

/// A message of points as it lies in memory: ROS' sensor_msgs/PointCloud2, or another that is made of equal records.
/// Owns nothing: names and points are those of the bytes that it was read from.
struct CloudView {
  /// Of a number in a record, as sensor_msgs/PointField counts them. Any other byte may stand in a message.
  enum class Type : std::uint8_t { int8 = 1, uint8, int16, uint16, int32, uint32, float32, float64 };
  struct Field {
    std::string_view name;
    std::uint32_t offset = 0; ///< bytes, in the record of a point
    Type type{};
  };
  static constexpr std::size_t kMaxFields = 32; ///< of which are read; others are not looked at

  Stamp stamp;            ///< of the header; Stamp{} where nobody set it
  Duration ahead{};       ///< of the time line that its arrival is in: to be taken off every time in it
  std::string_view frame; ///< of the header
  std::uint32_t height = 0, width = 0;
  std::uint32_t point_step = 0, row_step = 0; ///< bytes from one point, one row to the next
  bool is_big_endian = false;
  std::size_t field_count = 0;
  std::array<Field, kMaxFields> storage;
  std::span<const std::byte> data;

  [[nodiscard]] std::span<const Field> fields() const { return {storage.data(), field_count}; }
};

/// The types of the messages that are clouds, as ROS 1 writes them.
inline constexpr std::string_view kPointCloudType = "sensor_msgs/PointCloud2";
constexpr bool is_livox_type(std::string_view type) {
  return type == "livox_ros_driver/CustomMsg" || type == "livox_ros_driver2/CustomMsg";
}
constexpr bool is_cloud_type(std::string_view type) { return type == kPointCloudType || is_livox_type(type); }

/// Reads a message of one of these types; nothing for one that breaks off. What it claims of its points may be wrong
/// still, see layout_of(). Any bytes will do. Any thread; allocates nothing, throws nothing.
std::optional<CloudView> read_cloud(MessageReader reader, std::string_view type);

} // namespace locus

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

/// View of a cloud message in memory: ROS sensor_msgs/PointCloud2, or another message of equal records. Non-owning:
/// names and points refer to the bytes that it was read from.
struct CloudView {
  /// Number type in a record, as in sensor_msgs/PointField. A message may hold any other byte as well.
  enum class Type : std::uint8_t { int8 = 1, uint8, int16, uint16, int32, uint32, float32, float64 };
  struct Field {
    std::string_view name;
    std::uint32_t offset = 0; ///< bytes, in the record of a point
    Type type{};
  };
  static constexpr std::size_t kMaxFields = 32; ///< number of fields read; further fields are ignored

  Stamp stamp;      ///< from the header; Stamp{} if not set
  Duration ahead{}; ///< host's clock relative to the time base of its arrival; subtract from every time of the message
  std::string_view frame; ///< from the header
  std::uint32_t height = 0, width = 0;
  std::uint32_t point_step = 0, row_step = 0; ///< bytes from one point, one row to the next
  bool is_big_endian = false;
  std::size_t field_count = 0;
  std::array<Field, kMaxFields> storage;
  std::span<const std::byte> data;

  [[nodiscard]] std::span<const Field> fields() const { return {storage.data(), field_count}; }
};

/// Message types of clouds, in ROS 1 notation.
inline constexpr std::string_view kPointCloudType = "sensor_msgs/PointCloud2";
inline constexpr std::string_view kLivoxCloudType = "livox_ros_driver2/CustomMsg";
constexpr bool is_livox_type(std::string_view type) {
  return type == kLivoxCloudType || type == "livox_ros_driver/CustomMsg";
}
constexpr bool is_cloud_type(std::string_view type) { return type == kPointCloudType || is_livox_type(type); }

/// Reads a message of one of these types; empty if it is truncated. The point data may still be inconsistent, see
/// layout_of(). Safe for arbitrary bytes. Thread-safe; allocates nothing, throws nothing.
std::optional<CloudView> read_cloud(MessageReader reader, std::string_view type);

} // namespace locus

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "core/base/pose.hpp"
#include "core/base/stamp.hpp"
#include "drivers/clouds/cloud_view.hpp"

namespace locus::test {

/// A return of a VLP-16 in the frame of the lidar.
struct FiredPoint {
  Eigen::Vector3f p_m;
  std::uint8_t ring, intensity;
  Stamp fired;
};

/// All returns of 0.1 s, in firing order.
struct CloudTurn {
  Stamp begin; ///< start of the turn, even if nothing returned then
  std::vector<FiredPoint> points;

  [[nodiscard]] Stamp end() const { return points.empty() ? begin : points.back().fired; }
};

/// Returns the turns of a capture's first lidar, without its first `left_out` packets. Packets are stamped by
/// reception.
std::vector<CloudTurn> turns_of(const std::filesystem::path& capture, std::size_t left_out = 0);

/// Cloud layouts of common lidar drivers.
enum class CloudKind {
  velodyne,       ///< times before the header stamp
  velodyne_start, ///< times after the header stamp
  ouster,         ///< organised; missing returns are zeros
  ouster_destaggered,
  hesai,
  robosense,
  livox_points,
  livox_custom, ///< the driver's own message
  nebula,
  bare, ///< x, y, z, intensity
};
inline constexpr int kCloudKinds = 10;
std::string name_of(CloudKind kind);

/// A cloud message that owns its bytes.
struct OwnCloud {
  struct Field {
    std::string name;
    std::uint32_t offset;
    CloudView::Type type;
  };
  Stamp stamp;
  std::string frame = "lidar";
  std::uint32_t height = 1, width = 0, point_step = 0;
  std::vector<Field> fields;
  std::vector<std::byte> data;

  /// Valid until this cloud is modified.
  [[nodiscard]] CloudView view() const;
  [[nodiscard]] const Field& field(const std::string& name) const;
  /// Returns the field `name` of one point.
  template <class Number> [[nodiscard]] Number get(std::size_t point, const std::string& name) const;
  template <class Number> void set(std::size_t point, const std::string& name, Number value);
};

OwnCloud cloud_of(const CloudTurn& turn, CloudKind kind);

/// Appends a field to every point, all zero.
void add_field(OwnCloud& cloud, const std::string& name, CloudView::Type type);
/// Removes the field; its bytes stay as padding.
void remove_field(OwnCloud& cloud, const std::string& name);

template <class Number> Number OwnCloud::get(std::size_t point, const std::string& name) const {
  Number value{};
  std::memcpy(&value, data.data() + point * point_step + field(name).offset, sizeof(value));
  return value;
}

template <class Number> void OwnCloud::set(std::size_t point, const std::string& name, Number value) {
  std::memcpy(data.data() + point * point_step + field(name).offset, &value, sizeof(value));
}

} // namespace locus::test

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

/// All returns of a tenth of a second, in the order of their firing.
struct CloudTurn {
  Stamp begin; ///< of the turn, whether or not anything returned then
  std::vector<FiredPoint> points;

  [[nodiscard]] Stamp end() const { return points.empty() ? begin : points.back().fired; }
};

/// Those of the first lidar of a capture, its packets timed by reception, the first `left_out` of them left out.
std::vector<CloudTurn> turns_of(const std::filesystem::path& capture, std::size_t left_out = 0);

/// As the drivers of lidars write their clouds.
enum class CloudKind {
  velodyne,       ///< times before the header's stamp
  velodyne_start, ///< times after it
  ouster,         ///< rows of zeros where nothing returned
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

/// A message with its bytes.
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

  /// Valid while this is not changed.
  [[nodiscard]] CloudView view() const;
  [[nodiscard]] const Field& field(const std::string& name) const;
  /// Of the point at that place.
  template <class Number> [[nodiscard]] Number get(std::size_t point, const std::string& name) const;
  template <class Number> void set(std::size_t point, const std::string& name, Number value);
};

OwnCloud cloud_of(const CloudTurn& turn, CloudKind kind);

/// One more field at the end of every point, all zero.
void add_field(OwnCloud& cloud, const std::string& name, CloudView::Type type);
/// Without the field; its bytes stay, as padding.
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

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/pose.hpp"
#include "core/base/stamp.hpp"
#include "core/base/surface_point.hpp"
#include "core/ingest/sweep.hpp"

namespace locus {

/// Space that the lidars saw through in the last keyframes. An object there has arrived since: a person, a vehicle. It
/// must not enter the map, because a robot that is registered to moving objects moves with them. An object that stays
/// is inserted some keyframes later.
///
/// Visibility in range images, as in Pomerleau, Krüsi, Colas, Furgale, Siegwart, "Long-term 3D map maintenance in
/// dynamic environments", ICRA 2014. Reuses its memory. One owner.
class FreeSpace {
 public:
  /// Prepares for a keyframe: stores which lidar measured each point of the sweep, and from where. Cheap.
  void expect(const Sweep& sweep);

  /// Returns the points of the expected sweep (base frame, in its order) that are not in free space; they are stored in
  /// this object. Then adds the space in front of the points to the free space.
  std::span<const SurfacePoint> leave_out_moving(std::span<const SurfacePoint> scan_base, const Pose& T_odom_base);

  /// Drops all free space, when the pose relative to it has been lost.
  void clear() { keyframes_ = 0; }

 private:
  static constexpr std::size_t kKeyframes = 5;
  static constexpr int kColumns = 180, kRows = 60; ///< about two degrees each at the elevations of lidars

  /// Nearest returns of one lidar in one keyframe, by direction in base axes.
  struct View {
    Eigen::Vector3f lidar_odom_m;
    Eigen::Matrix3f R_view_odom;
    std::array<float, static_cast<std::size_t>(kColumns* kRows)> nearest_m; ///< zero: no return
  };
  struct Keyframe {
    Stamp stamp;
    std::vector<View> views; ///< by lidar
  };
  struct Cell {
    int column, row;
  };

  [[nodiscard]] static Cell cell_of(const Eigen::Vector3f& direction, float range_m);
  [[nodiscard]] static bool sees_through(const View& view, const Eigen::Vector3f& point_odom_m);
  [[nodiscard]] bool is_free(const Eigen::Vector3f& point_odom_m) const;
  void add_keyframe(std::span<const SurfacePoint> scan_base, const Pose& T_odom_base);

  std::array<Keyframe, kKeyframes> last_;
  std::size_t keyframes_ = 0; ///< since clear()
  Stamp stamp_;
  LidarPlaces lidars_;
  std::vector<std::uint8_t> lidar_of_; ///< by point
  std::vector<SurfacePoint> standing_;
};

} // namespace locus

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

/// The space that the lidars saw through in the last keyframes. What stands there now has come since: a person, a
/// vehicle. It is not for the map, for a robot that finds its place by what moves moves with it. What has come to stay
/// is taken in some keyframes later.
///
/// Visibility in range images, as in Pomerleau, Krüsi, Colas, Furgale, Siegwart, "Long-term 3D map maintenance in
/// dynamic environments", ICRA 2014. Keeps its memory. One owner.
class FreeSpace {
 public:
  /// A sweep will be a keyframe: remembers which lidar sees each of its points, and from where. Cheap.
  void expect(const Sweep& sweep);

  /// The points of the expected sweep (base frame, in its order) that do not stand in free space; they lie in this
  /// object. Then the sweep has seen through what is before its points, too.
  std::span<const SurfacePoint> leave_out_moving(std::span<const SurfacePoint> scan_base, const Pose& T_odom_base);

  /// Where the robot was is not known any more, and so neither is what it saw through.
  void forget() { keyframes_ = 0; }

 private:
  static constexpr std::size_t kKeyframes = 5;
  static constexpr int kColumns = 180, kRows = 60; ///< of about two degrees, as far as lidars look up and down

  /// What one lidar has seen of one keyframe, by direction; axes of the base.
  struct View {
    Eigen::Vector3f lidar_odom_m;
    Eigen::Matrix3f R_view_odom;
    std::array<float, static_cast<std::size_t>(kColumns* kRows)> nearest_m; ///< zero: nothing
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
  void see(std::span<const SurfacePoint> scan_base, const Pose& T_odom_base);

  std::array<Keyframe, kKeyframes> last_;
  std::size_t keyframes_ = 0; ///< since it forgot
  Stamp stamp_;
  LidarPlaces lidars_;
  std::vector<std::uint8_t> lidar_of_; ///< by point
  std::vector<SurfacePoint> standing_;
};

} // namespace locus

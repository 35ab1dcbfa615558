// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "core/base/pose.hpp"
#include "core/base/stamp.hpp"
#include "core/base/surface_point.hpp"
#include "core/ingest/sweep.hpp"
#include "core/map/surface_map.hpp"

namespace locus {

/// Space that the lidars saw through in the last keyframes, and the surfaces that ended it. An object in free space has
/// arrived since: a person, a vehicle. It must not enter the map, because a robot that is registered to moving objects
/// moves with them. An object that stays is inserted some keyframes later.
///
/// No beam passes through a surface either: a return from behind the returns of the last keyframe, where the map is
/// empty, is that of a faulty lidar, or the surface in front has moved. It waits for the next keyframe, which sees
/// behind the surface if that has moved.
///
/// Visibility in range images, as in Pomerleau, Krüsi, Colas, Furgale, Siegwart, "Long-term 3D map maintenance in
/// dynamic environments", ICRA 2014. Reuses its memory. One owner.
class FreeSpace {
 public:
  /// Prepares for a keyframe: stores which lidar measured each point of the sweep, and from where. Cheap.
  void expect(const Sweep& sweep);

  /// Returns the points of the expected sweep (base frame, in its order) that agree with the last keyframes: neither in
  /// free space nor, unless they lie on a surface of the `map`, hidden. They are stored in this object. Then adds the
  /// space in front of the points to the free space.
  std::span<const SurfacePoint> leave_out_contradicting(std::span<const SurfacePoint> scan_base,
                                                        const Pose& T_odom_base, const SurfaceMap& map);

  /// Drops all free space, when the pose relative to it has been lost.
  void clear() { keyframes_ = 0; }

 private:
  static constexpr std::size_t kKeyframes = 5;
  static constexpr int kColumns = 180, kRows = 60; ///< about two degrees each at the elevations of lidars

  /// Ranges of the returns in one direction: more than one where a surface is porous, like grass, or ends.
  struct Returns {
    float nearest_m = std::numeric_limits<float>::infinity();
    float farthest_m = 0.0F; ///< zero: no return
  };

  /// Returns of one lidar in one keyframe, by direction in base axes.
  struct View {
    Eigen::Vector3f lidar_odom_m;
    Eigen::Matrix3f R_view_odom;
    std::array<Returns, static_cast<std::size_t>(kColumns* kRows)> returns;
  };
  struct Keyframe {
    Stamp stamp;
    std::vector<View> views; ///< by lidar
  };
  struct Cell {
    int column, row;
  };

  [[nodiscard]] static Cell cell_of(const Eigen::Vector3f& direction, float range_m);
  template <class Condition>
  [[nodiscard]] static std::optional<int> count_around(const View& view, const Eigen::Vector3f& point_odom_m,
                                                       const Condition& holds);
  [[nodiscard]] static bool sees_through(const View& view, const Eigen::Vector3f& point_odom_m);
  [[nodiscard]] bool is_free(const Eigen::Vector3f& point_odom_m) const;
  [[nodiscard]] bool is_hidden(const Eigen::Vector3f& point_odom_m) const;
  [[nodiscard]] bool is_recent(const Keyframe& keyframe) const;
  void add_keyframe(std::span<const SurfacePoint> scan_base, const Pose& T_odom_base);

  std::array<Keyframe, kKeyframes> last_;
  std::size_t keyframes_ = 0; ///< since clear()
  Stamp stamp_;
  LidarPlaces lidars_;
  std::vector<std::uint8_t> lidar_of_; ///< by point
  std::vector<SurfacePoint> standing_;
};

} // namespace locus

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <random>
#include <vector>

#include "core/map/surface_map.hpp"

namespace locus::test {

/// A rectangle from which points are sampled.
struct Patch {
  Eigen::Vector3d corner_m;
  Eigen::Vector3d edge_u_m, edge_v_m; ///< perpendicular
  double share = 1.0;                 ///< relative number of points
};

/// Points spread evenly over flat patches, with their true normals. Deterministic.
inline std::vector<SurfacePoint> points_on(const std::vector<Patch>& patches, std::size_t per_patch, unsigned seed = 1,
                                           double noise_m = 0.0) {
  std::mt19937 random{seed};
  std::uniform_real_distribution<double> along;
  std::normal_distribution<double> noise;
  std::vector<SurfacePoint> points;
  for (const Patch& patch : patches) {
    const Eigen::Vector3d normal = patch.edge_u_m.cross(patch.edge_v_m).normalized();
    const auto count = static_cast<std::size_t>(patch.share * static_cast<double>(per_patch));
    for (std::size_t i = 0; i < count; ++i) {
      const double u = along(random), v = along(random);
      const Eigen::Vector3d p =
          patch.corner_m + u * patch.edge_u_m + v * patch.edge_v_m + noise_m * noise(random) * normal;
      points.push_back({p.cast<float>(), normal.cast<float>()});
    }
  }
  return points;
}

inline std::vector<SurfacePoint> without_normals(std::vector<SurfacePoint> points) {
  for (SurfacePoint& point : points)
    point.normal.setZero();
  return points;
}

/// Transforms the points to the frame of a base at T_map_base.
inline std::vector<SurfacePoint> seen_from(const Pose& T_map_base, std::vector<SurfacePoint> points_map) {
  const Pose T_base_map = T_map_base.inverse();
  for (SurfacePoint& point : points_map) {
    point.position_m = (T_base_map * point.position_m.cast<double>().eval()).cast<float>();
    point.normal = (T_base_map.rotation * point.normal.cast<double>()).cast<float>();
  }
  return points_map;
}

/// Floor, walls and a counter of a room of 10 x 8 x 3 m around the origin.
inline std::vector<Patch> furnished_room() {
  return {{{-5, -4, 0}, {10, 0, 0}, {0, 8, 0}},       {{-5, -4, 0}, {10, 0, 0}, {0, 0, 3}},
          {{-5, 4, 0}, {10, 0, 0}, {0, 0, 3}},        {{-5, -4, 0}, {0, 8, 0}, {0, 0, 3}},
          {{5, -4, 0}, {0, 8, 0}, {0, 0, 3}},         {{2, -1, 0}, {0, 2.5, 0}, {0, 0, 1}, 0.3},
          {{2, -1, 1}, {1.5, 0, 0}, {0, 2.5, 0}, 0.3}};
}

/// Floor and two walls along x: the position along x is unobservable.
inline std::vector<Patch> endless_corridor() {
  return {{{-30, -1.5, 0}, {60, 0, 0}, {0, 3, 0}},
          {{-30, -1.5, 0}, {60, 0, 0}, {0, 0, 3}},
          {{-30, 1.5, 0}, {60, 0, 0}, {0, 0, 3}}};
}

} // namespace locus::test

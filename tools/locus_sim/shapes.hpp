// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <limits>
#include <variant>

namespace locus::sim {

inline constexpr double kNowhere = std::numeric_limits<double>::infinity(); ///< range of a ray without hit

/// Ray with a direction of unit length, world frame.
struct Ray {
  Eigen::Vector3d origin_m;
  Eigen::Vector3d direction;
};

/// Axis-aligned bounds, world frame.
struct Bounds {
  Eigen::Vector3d min_m, max_m;
};

/// Returns the union of both.
Bounds united(const Bounds& a, const Bounds& b);

/// Shapes of a scene. Each is a surface without thickness, visible from both sides, that provides the range of a ray's
/// first hit (metres along the ray, or kNowhere), the unit normal (of either sign) at the nearest point, the distance
/// of a point, and its bounds.

struct Rectangle {
  Eigen::Vector3d corner_m;
  Eigen::Vector3d edge_u_m, edge_v_m; ///< perpendicular to each other

  [[nodiscard]] double range_m(const Ray& ray) const;
  [[nodiscard]] Eigen::Vector3d normal(const Eigen::Vector3d& point) const;
  [[nodiscard]] double distance_m(const Eigen::Vector3d& point) const;
  [[nodiscard]] Bounds bounds() const;
};

/// Upright box, turned about z. Viewed from inside it is a room.
struct Box {
  Eigen::Vector3d center_m;
  Eigen::Vector3d half_size_m;
  double cos_yaw = 1.0, sin_yaw = 0.0;

  [[nodiscard]] double range_m(const Ray& ray) const;
  [[nodiscard]] Eigen::Vector3d normal(const Eigen::Vector3d& point) const;
  [[nodiscard]] double distance_m(const Eigen::Vector3d& point) const;
  [[nodiscard]] Bounds bounds() const;
};

/// Tube, open at both ends.
struct Cylinder {
  Eigen::Vector3d base_m; ///< centre of one end
  double radius_m;
  double height_m;
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ(); ///< from that end to the other, unit length

  [[nodiscard]] double range_m(const Ray& ray) const;
  [[nodiscard]] Eigen::Vector3d normal(const Eigen::Vector3d& point) const;
  [[nodiscard]] double distance_m(const Eigen::Vector3d& point) const;
  [[nodiscard]] Bounds bounds() const;
};

struct Triangle {
  Eigen::Vector3d corner_m;
  Eigen::Vector3d edge_u_m, edge_v_m; ///< to the other two corners

  [[nodiscard]] double range_m(const Ray& ray) const;
  [[nodiscard]] Eigen::Vector3d normal(const Eigen::Vector3d& point) const;
  [[nodiscard]] double distance_m(const Eigen::Vector3d& point) const;
  [[nodiscard]] Bounds bounds() const;
};

struct Sphere {
  Eigen::Vector3d center_m;
  double radius_m;

  [[nodiscard]] double range_m(const Ray& ray) const;
  [[nodiscard]] Eigen::Vector3d normal(const Eigen::Vector3d& point) const;
  [[nodiscard]] double distance_m(const Eigen::Vector3d& point) const;
  [[nodiscard]] Bounds bounds() const;
};

/// Shape with the reflectivity measured by a lidar.
struct Surface {
  std::variant<Rectangle, Triangle, Box, Cylinder, Sphere> shape;
  std::uint8_t reflectivity = 50;
};

} // namespace locus::sim

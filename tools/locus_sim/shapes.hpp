// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <limits>
#include <variant>

namespace locus::sim {

inline constexpr double kNowhere = std::numeric_limits<double>::infinity(); ///< along a ray that meets nothing

/// A ray from a point in a direction of unit length, world frame.
struct Ray {
  Eigen::Vector3d origin_m;
  Eigen::Vector3d direction;
};

/// Axis-aligned bounds, world frame.
struct Bounds {
  Eigen::Vector3d min_m, max_m;
};

/// The bounds of both.
Bounds united(const Bounds& a, const Bounds& b);

/// The shapes a scene is made of. Each is a surface without thickness, seen from both sides, and answers four
/// questions: where a ray first meets it (metres along the ray, or kNowhere), its unit normal (to either
/// side) nearest to a point on it, how far a point is from it, and its bounds.

struct Rectangle {
  Eigen::Vector3d corner_m;
  Eigen::Vector3d edge_u_m, edge_v_m; ///< perpendicular to each other

  [[nodiscard]] double range_m(const Ray& ray) const;
  [[nodiscard]] Eigen::Vector3d normal(const Eigen::Vector3d& point) const;
  [[nodiscard]] double distance_m(const Eigen::Vector3d& point) const;
  [[nodiscard]] Bounds bounds() const;
};

/// Upright box, turned about z. From inside it is a room.
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

/// A shape with the brightness that a lidar sees.
struct Surface {
  std::variant<Rectangle, Triangle, Box, Cylinder, Sphere> shape;
  std::uint8_t reflectivity = 50;
};

} // namespace locus::sim

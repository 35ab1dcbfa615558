// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <optional>
#include <variant>
#include <vector>

namespace locus::sim {

/// A ray from a point in a direction of unit length, world frame.
struct Ray {
  Eigen::Vector3d origin_m;
  Eigen::Vector3d direction;
};

/// Axis-aligned bounds, world frame.
struct Bounds {
  Eigen::Vector3d min_m, max_m;
};

/// The shapes a scene is made of. Each is a surface without thickness, seen from both sides, and answers three
/// questions: where a ray first meets it (metres along the ray, infinity when nowhere), how far a point is from it, and
/// its bounds.

struct Rectangle {
  Eigen::Vector3d corner_m;
  Eigen::Vector3d edge_u_m, edge_v_m; ///< perpendicular to each other

  [[nodiscard]] double range_m(const Ray& ray) const;
  [[nodiscard]] double distance_m(const Eigen::Vector3d& point) const;
  [[nodiscard]] Bounds bounds() const;
};

/// Upright box, turned about z. From inside it is a room.
struct Box {
  Eigen::Vector3d center_m;
  Eigen::Vector3d half_size_m;
  double cos_yaw = 1.0, sin_yaw = 0.0;

  [[nodiscard]] double range_m(const Ray& ray) const;
  [[nodiscard]] double distance_m(const Eigen::Vector3d& point) const;
  [[nodiscard]] Bounds bounds() const;
};

/// Upright tube, open at both ends.
struct Cylinder {
  Eigen::Vector3d base_m; ///< centre of its lower end
  double radius_m;
  double height_m;

  [[nodiscard]] double range_m(const Ray& ray) const;
  [[nodiscard]] double distance_m(const Eigen::Vector3d& point) const;
  [[nodiscard]] Bounds bounds() const;
};

struct Sphere {
  Eigen::Vector3d center_m;
  double radius_m;

  [[nodiscard]] double range_m(const Ray& ray) const;
  [[nodiscard]] double distance_m(const Eigen::Vector3d& point) const;
  [[nodiscard]] Bounds bounds() const;
};

/// A shape with the brightness that a lidar sees.
struct Surface {
  std::variant<Rectangle, Box, Cylinder, Sphere> shape;
  std::uint8_t reflectivity = 50;
};

struct Hit {
  double range_m;
  std::uint8_t reflectivity;
};

/// A world that stands still and can be asked, exactly, what a ray meets. Immutable, any thread. A tree of bounding
/// boxes makes a ray cost the logarithm of the number of surfaces, so a street of 15 km needs no trick.
class Scene {
 public:
  explicit Scene(std::vector<Surface> surfaces);

  /// The first surface within `max_range_m`, or nothing.
  [[nodiscard]] std::optional<Hit> cast(const Ray& ray, double max_range_m) const;

  /// From the point to the nearest surface, seen or hidden.
  [[nodiscard]] double distance_to_surface(const Eigen::Vector3d& point) const;

 private:
  struct Node {
    Bounds bounds;
    std::uint32_t first; ///< leaf: its first surface; branch: its second child, the first one follows the node itself
    std::uint16_t count; ///< surfaces of a leaf; 0 for a branch
    std::uint16_t axis;  ///< along which a branch was split
  };

  void build(std::uint32_t begin, std::uint32_t end);

  std::vector<Surface> surfaces_; ///< in the order of the leaves
  std::vector<Node> nodes_;       ///< depth first
};

} // namespace locus::sim

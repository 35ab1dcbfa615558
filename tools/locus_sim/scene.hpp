// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/stamp.hpp"
#include "locus_sim/shapes.hpp"

namespace locus::sim {

/// What a ray meets.
struct Hit {
  Eigen::Vector3d point_m;
  double range_m;
  double cos_incidence; ///< of the angle between ray and normal, 0..1
  std::uint8_t reflectivity;
  const Surface* surface; ///< nothing: it moves
};

/// Something upright that goes to and fro between two places: a person, a forklift.
struct Mover {
  std::vector<Surface> parts;   ///< around the origin
  Eigen::Vector3d from_m, to_m; ///< of the origin
  double period_s;              ///< there and back
  double phase = 0;             ///< of a period, 0..1

  [[nodiscard]] Eigen::Vector3d position_m(Stamp stamp) const;
  [[nodiscard]] Bounds bounds() const; ///< of all it ever reaches
};

/// A world that can be asked, exactly, what a ray meets. Immutable, any thread. A tree of bounding boxes makes a ray
/// cost the logarithm of the number of surfaces, so a street of 15 km needs no trick.
class Scene {
 public:
  explicit Scene(std::vector<Surface> surfaces, std::vector<Mover> movers = {});

  /// The first surface within `max_range_m`, or nothing. Where nothing moves, any stamp will do. `guess`, the surface
  /// that a ray like this one has met, makes it faster.
  [[nodiscard]] std::optional<Hit> cast(const Ray& ray, double max_range_m, Stamp stamp = {},
                                        const Surface* guess = nullptr) const;

  /// From the point to the nearest surface, seen or hidden.
  [[nodiscard]] double distance_to_surface(const Eigen::Vector3d& point, Stamp stamp = {}) const;

  [[nodiscard]] const std::vector<Surface>& surfaces() const { return surfaces_; } ///< all that stands still
  [[nodiscard]] const Bounds& bounds() const { return bounds_; }                   ///< of them

 private:
  /// Four children, one per lane. Single precision finds who may be met; where, is reckoned in double precision.
  struct Node {
    using Lanes = Eigen::Array4f;
    std::array<Lanes, 3> min_m, max_m;  ///< of x, y and z
    std::array<std::uint32_t, 4> child; ///< a node, or a surface, which is marked
  };
  class TreeMaker;
  struct Met {
    double range_m;
    const Surface* surface = nullptr;
    const Mover* mover = nullptr;
  };

  void cast_at_surfaces(const Ray& ray, Met& nearest) const;
  void cast_at_movers(const Ray& ray, Stamp stamp, Met& nearest) const;

  std::vector<Surface> surfaces_; ///< in the order of the tree
  std::vector<Node> nodes_;       ///< the last one is the root
  std::vector<Mover> movers_;
  std::vector<Bounds> mover_bounds_;
  Bounds bounds_;
};

} // namespace locus::sim

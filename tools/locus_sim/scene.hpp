// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "core/base/stamp.hpp"
#include "locus_sim/hit.hpp"
#include "locus_sim/mirrors.hpp"
#include "locus_sim/passer.hpp"
#include "locus_sim/scene_tree.hpp"
#include "locus_sim/shapes.hpp"
#include "locus_sim/steam.hpp"

namespace locus::sim {

/// Upright object that moves to and fro between two places: a person, a forklift.
struct Mover {
  std::vector<Surface> parts;   ///< relative to the origin
  Eigen::Vector3d from_m, to_m; ///< of the origin
  double period_s;              ///< there and back
  double phase = 0;             ///< share of a period, 0..1

  [[nodiscard]] Eigen::Vector3d position_m(Stamp stamp) const;
  [[nodiscard]] Bounds bounds() const; ///< of all its positions
};

/// World for exact ray casting. Immutable once built, any thread. A hierarchy of bounding boxes makes the cost of a ray
/// logarithmic in the number of surfaces, even for a road of 15 km.
class Scene {
 public:
  explicit Scene(std::vector<Surface> surfaces, std::vector<Mover> movers = {}, std::vector<Passer> passers = {});

  void add(Passer passer) { passers_.push_back(std::move(passer)); }
  void add(Steam steam) { steam_ = std::move(steam); }
  void add(const Mirrors& mirrors) { mirrors_ = mirrors; }

  /// Returns the first surface within `max_range_m`, if any, with the effects of steam and mirrors. The stamp matters
  /// only with moving objects. `guess`, the surface hit by a similar ray, speeds it up.
  [[nodiscard]] std::optional<Hit> cast(const Ray& ray, double max_range_m, Stamp stamp = {},
                                        const Surface* guess = nullptr) const;

  /// Returns the distance from the point to the nearest surface, visible or not.
  [[nodiscard]] double distance_to_surface(const Eigen::Vector3d& point, Stamp stamp = {}) const;

  [[nodiscard]] const std::vector<Surface>& surfaces() const { return surfaces_; } ///< static surfaces
  [[nodiscard]] const Bounds& bounds() const { return bounds_; }                   ///< of the static surfaces
  [[nodiscard]] const std::vector<Passer>& passers() const { return passers_; }
  [[nodiscard]] const Steam& steam() const { return steam_; }

 private:
  struct Met {
    double range_m;
    const Surface* surface = nullptr;
    const Mover* mover = nullptr;
  };

  [[nodiscard]] std::optional<Hit> cast_at_solid(const Ray& ray, double max_range_m, Stamp stamp,
                                                 const Surface* guess) const;
  [[nodiscard]] std::optional<Hit> through_steam(const Ray& ray, const std::optional<Hit>& solid, double max_range_m,
                                                 Stamp stamp, QuickDice& dice) const;
  [[nodiscard]] std::optional<Hit> in_mirror(const Ray& ray, const Hit& solid, double max_range_m, Stamp stamp,
                                             QuickDice& dice) const;
  void cast_at_surfaces(const Ray& ray, Met& nearest) const;
  void cast_at_movers(const Ray& ray, Stamp stamp, Met& nearest) const;

  std::vector<Surface> surfaces_; ///< in tree order
  std::vector<TreeNode> nodes_;   ///< root last
  std::vector<Mover> movers_;
  std::vector<Bounds> mover_bounds_;
  std::vector<Passer> passers_;
  Steam steam_{{}};
  std::optional<Mirrors> mirrors_;
  Bounds bounds_;
};

} // namespace locus::sim

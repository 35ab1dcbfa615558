// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/stamp.hpp"
#include "locus_sim/hit.hpp"
#include "locus_sim/mirrors.hpp"
#include "locus_sim/passer.hpp"
#include "locus_sim/shapes.hpp"
#include "locus_sim/steam.hpp"

namespace locus::sim {

/// Something upright that goes to and fro between two places: a person, a forklift.
struct Mover {
  std::vector<Surface> parts;   ///< around the origin
  Eigen::Vector3d from_m, to_m; ///< of the origin
  double period_s;              ///< there and back
  double phase = 0;             ///< of a period, 0..1

  [[nodiscard]] Eigen::Vector3d position_m(Stamp stamp) const;
  [[nodiscard]] Bounds bounds() const; ///< of all it ever reaches
};

/// A world that can be asked, exactly, what a ray meets. Once it is furnished immutable, any thread. A tree of bounding
/// boxes makes a ray cost the logarithm of the number of surfaces, so a street of 15 km needs no trick.
class Scene {
 public:
  explicit Scene(std::vector<Surface> surfaces, std::vector<Mover> movers = {}, std::vector<Passer> passers = {});

  void add(Passer passer) { passers_.push_back(std::move(passer)); }
  void add(Steam steam) { steam_ = std::move(steam); }
  void add(const Mirrors& mirrors) { mirrors_ = mirrors; }

  /// The first surface within `max_range_m`, or nothing; or what steam and mirrors make of it. Where nothing moves, any
  /// stamp will do. `guess`, the surface that a ray like this one has met, makes it faster.
  [[nodiscard]] std::optional<Hit> cast(const Ray& ray, double max_range_m, Stamp stamp = {},
                                        const Surface* guess = nullptr) const;

  /// From the point to the nearest surface, seen or hidden.
  [[nodiscard]] double distance_to_surface(const Eigen::Vector3d& point, Stamp stamp = {}) const;

  [[nodiscard]] const std::vector<Surface>& surfaces() const { return surfaces_; } ///< all that stands still
  [[nodiscard]] const Bounds& bounds() const { return bounds_; }                   ///< of them
  [[nodiscard]] const std::vector<Passer>& passers() const { return passers_; }
  [[nodiscard]] const Steam& steam() const { return steam_; }

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

  [[nodiscard]] std::optional<Hit> cast_at_solid(const Ray& ray, double max_range_m, Stamp stamp,
                                                 const Surface* guess) const;
  [[nodiscard]] std::optional<Hit> through_steam(const Ray& ray, const std::optional<Hit>& solid, double max_range_m,
                                                 Stamp stamp, QuickDice& dice) const;
  [[nodiscard]] std::optional<Hit> in_mirror(const Ray& ray, const Hit& solid, double max_range_m, Stamp stamp,
                                             QuickDice& dice) const;
  void cast_at_surfaces(const Ray& ray, Met& nearest) const;
  void cast_at_movers(const Ray& ray, Stamp stamp, Met& nearest) const;

  std::vector<Surface> surfaces_; ///< in the order of the tree
  std::vector<Node> nodes_;       ///< the last one is the root
  std::vector<Mover> movers_;
  std::vector<Bounds> mover_bounds_;
  std::vector<Passer> passers_;
  Steam steam_{{}};
  std::optional<Mirrors> mirrors_;
  Bounds bounds_;
};

} // namespace locus::sim

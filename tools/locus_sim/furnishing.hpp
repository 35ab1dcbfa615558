// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "locus_sim/dice.hpp"
#include "locus_sim/roads.hpp"
#include "locus_sim/scene_builder.hpp"

namespace locus::sim {

/// A rectangle on the floor with sides along x and y.
struct Area {
  Eigen::Vector2d min_m, max_m;
};

/// What worlds are furnished with. Nothing of it is quite regular: builders are not.
class Furnishing {
 public:
  Furnishing(SceneBuilder& build, const Roads& roads, Dice& dice) : build_(build), roads_(roads), dice_(dice) {}

  /// Level, in slabs of at most 5 m that lie within millimetres of each other and of z.
  void slabs(const Area& area, double z_m, std::uint8_t bright);

  /// A wall from the ground to `height_m`, as thick as the area is, in panels along its longer side that stand within a
  /// centimetre of a line; with doorways, 3 m wide and high, wherever a road passes through it.
  void wall(const Area& area, double height_m, std::uint8_t bright);

  /// Crates, drums, cabinets, poles and tanks that leave the roads free.
  void clutter(const Area& area, int count, double max_size_m);

  /// Pipes along a line at a height, on brackets at uneven distances; `count` of them one above the other.
  void pipes(const Eigen::Vector3d& from, const Eigen::Vector3d& to, int count);

  /// Posts and two rails along a line on the ground of the given ends.
  void railing(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

  /// Someone who walks to and fro, 1.3 m/s at most.
  void person(const Eigen::Vector2d& from, const Eigen::Vector2d& to);
  void forklift(const Eigen::Vector2d& from, const Eigen::Vector2d& to);

 private:
  void wall_panel(const Area& area, double from_z, double to_z, std::uint8_t bright);
  void item(const Eigen::Vector2d& at, double size_m);

  SceneBuilder& build_;
  const Roads& roads_;
  Dice& dice_;
};

} // namespace locus::sim

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "locus_sim/dice.hpp"
#include "locus_sim/roads.hpp"
#include "locus_sim/scene_builder.hpp"

namespace locus::sim {

/// Rectangle on the floor with sides along x and y.
struct Area {
  Eigen::Vector2d min_m, max_m;
};

/// Furnishes worlds, with the irregularities of real buildings.
class Furnishing {
 public:
  Furnishing(SceneBuilder& build, const Roads& roads, Dice& dice) : build_(build), roads_(roads), dice_(dice) {}

  /// Adds a level floor of slabs of at most 5 m, uneven by millimetres.
  void slabs(const Area& area, double z_m, std::uint8_t bright);

  /// Adds a wall from the ground to `height_m`, as thick as the area, of panels along its longer side that deviate by
  /// up to a centimetre; with doorways, 3 m wide and high, wherever a road passes through it.
  void wall(const Area& area, double height_m, std::uint8_t bright);

  /// Adds crates, drums, cabinets, poles and tanks that leave the roads free.
  void clutter(const Area& area, int count, double max_size_m);

  /// Adds pipes along a line at a height, on unevenly spaced brackets; `count` of them one above the other.
  void pipes(const Eigen::Vector3d& from, const Eigen::Vector3d& to, int count);

  /// Adds posts and two rails along a line on the ground.
  void railing(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

  /// Adds a person who walks to and fro, at most at 1.3 m/s.
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

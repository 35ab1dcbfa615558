// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "locus_sim/scene.hpp"

namespace locus::sim {

/// Collects surfaces, specified in an architect's terms: by corners and centres on the floor. One owner.
class SceneBuilder {
 public:
  void rectangle(const Eigen::Vector3d& corner, const Eigen::Vector3d& u, const Eigen::Vector3d& v,
                 std::uint8_t bright) {
    surfaces_.push_back({Rectangle{corner, u, v}, bright});
  }
  void triangle(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c, std::uint8_t bright) {
    surfaces_.push_back({Triangle{a, b - a, c - a}, bright});
  }
  void box(const Eigen::Vector3d& min, const Eigen::Vector3d& max, std::uint8_t bright) {
    surfaces_.push_back({Box{(min + max) / 2, (max - min) / 2}, bright});
  }
  void turned_box(const Eigen::Vector3d& floor_center, const Eigen::Vector3d& size, double yaw_rad,
                  std::uint8_t bright) {
    const Eigen::Vector3d center = floor_center + Eigen::Vector3d{0, 0, size.z() / 2};
    surfaces_.push_back({Box{center, size / 2, std::cos(yaw_rad), std::sin(yaw_rad)}, bright});
  }
  void cylinder(const Eigen::Vector3d& base, double radius, double height, std::uint8_t bright) {
    surfaces_.push_back({Cylinder{base, radius, height}, bright});
  }
  void pipe(const Eigen::Vector3d& from, const Eigen::Vector3d& to, double radius, std::uint8_t bright) {
    surfaces_.push_back({Cylinder{from, radius, (to - from).norm(), (to - from).normalized()}, bright});
  }
  void sphere(const Eigen::Vector3d& center, double radius, std::uint8_t bright) {
    surfaces_.push_back({Sphere{center, radius}, bright});
  }
  void mover(Mover mover) { movers_.push_back(std::move(mover)); }

  void passer(Passer passer) { passers_.push_back(std::move(passer)); }

  Scene scene() { return Scene(std::move(surfaces_), std::move(movers_), std::move(passers_)); }

 private:
  std::vector<Surface> surfaces_;
  std::vector<Mover> movers_;
  std::vector<Passer> passers_;
};

} // namespace locus::sim

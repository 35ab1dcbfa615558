// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "locus_sim/furnishing.hpp"
#include "locus_sim/world.hpp"

namespace locus::sim {
namespace {

// Plan view of the road: four lanes. Robots use the second from inside; traffic uses the first and the last, driving on
// the right; the third is for overtaking.
constexpr double kLane_m = 3.5, kInnerEdge_m = 1.5 * kLane_m, kOuterEdge_m = 2.5 * kLane_m; // from the robot's lane
constexpr std::size_t kCorners = 24;

/// Lists the corners of the loop around the town, counterclockwise.
std::vector<Eigen::Vector2d> corners() {
  std::vector<Eigen::Vector2d> all;
  for (std::size_t i = 0; i < kCorners; ++i) {
    const double angle = 2 * std::numbers::pi * static_cast<double>(i) / kCorners;
    const double radius_m = 350 + 22 * std::cos(2 * angle + 0.4) + 9 * std::sin(3 * angle);
    all.emplace_back(radius_m * std::cos(angle), radius_m * std::sin(angle));
  }
  return all;
}

/// Centre line of the loop by length, its corners rounded to the curvature of a car.
class Loop {
 public:
  Loop() : corners_(corners()) {
    ends_m_.push_back(0);
    for (std::size_t i = 0; i < kCorners; ++i)
      ends_m_.push_back(ends_m_.back() + (corners_[(i + 1) % kCorners] - corners_[i]).norm());
  }
  [[nodiscard]] double length_m() const { return ends_m_.back(); }

  /// Returns a point; `aside_m` to the left, that is, inwards.
  [[nodiscard]] Eigen::Vector2d at(double along_m, double aside_m) const {
    const Eigen::Vector2d along = direction(along_m);
    return rounded(along_m) + aside_m * Eigen::Vector2d{-along.y(), along.x()};
  }
  [[nodiscard]] Eigen::Vector2d direction(double along_m) const {
    return (rounded(along_m + 1) - rounded(along_m - 1)).normalized();
  }
  [[nodiscard]] double heading_rad(double along_m) const {
    const Eigen::Vector2d along = direction(along_m);
    return std::atan2(along.y(), along.x());
  }

 private:
  [[nodiscard]] Eigen::Vector2d rounded(double along_m) const {
    constexpr double kHalf_m = 13;
    constexpr int kSamples = 8;
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    for (int i = 0; i < kSamples; ++i)
      sum += on_polygon(along_m + kHalf_m * ((2 * i + 1.0) / kSamples - 1));
    return sum / kSamples;
  }
  [[nodiscard]] Eigen::Vector2d on_polygon(double along_m) const {
    const double at_m = along_m - std::floor(along_m / length_m()) * length_m();
    const auto end = std::upper_bound(ends_m_.begin() + 1, ends_m_.end() - 1, at_m);
    const auto leg = static_cast<std::size_t>(end - ends_m_.begin()) - 1;
    const double share = (at_m - ends_m_[leg]) / (ends_m_[leg + 1] - ends_m_[leg]);
    return corners_[leg] + share * (corners_[(leg + 1) % kCorners] - corners_[leg]);
  }

  std::vector<Eigen::Vector2d> corners_;
  std::vector<double> ends_m_; ///< of each leg; first element: 0
};

Roads roads() {
  const std::vector<Eigen::Vector2d> all = corners();
  Roads roads;
  for (std::size_t i = 0; i < kCorners; ++i)
    roads.add({all[i], all[(i + 1) % kCorners]});
  return roads;
}

/// Builds asphalt, and grass as far as a lidar reaches.
void ground(SceneBuilder& build, const Roads& roads, Dice& dice) {
  constexpr double kSite_m = 440, kSlab_m = 5, kSeen_m = 45;
  for (double x = -kSite_m; x < kSite_m; x += kSlab_m) {
    for (double y = -kSite_m; y < kSite_m; y += kSlab_m) {
      const double off_m = roads.distance_m({x + kSlab_m / 2, y + kSlab_m / 2});
      if (off_m > kSeen_m)
        continue;
      const double height_m = dice.between(-0.004, 0.004);
      build.rectangle({x - 0.01, y - 0.01, height_m}, {kSlab_m + 0.02, 0, 0}, {0, kSlab_m + 0.02, 0},
                      off_m < kOuterEdge_m ? 16 : 26);
    }
  }
}

/// Builds houses of two to four storeys, with porches, all different.
void houses(SceneBuilder& build, const Loop& loop, Dice& dice) {
  for (const double side : {1.0, -1.0}) {
    for (double at = 0; at < loop.length_m() - 15; at += dice.between(16, 34)) {
      if (dice.chance(0.2)) // a garden
        continue;
      const double long_m = dice.between(9, 15), deep_m = dice.between(8, 12), high_m = dice.between(5, 12);
      const double edge_m = side > 0 ? kInnerEdge_m : kOuterEdge_m;
      const double aside_m = side * (edge_m + dice.between(6, 12) + deep_m / 2);
      const Eigen::Vector2d place = loop.at(at, aside_m);
      const double yaw_rad = loop.heading_rad(at) + dice.between(-0.05, 0.05);
      build.turned_box({place.x(), place.y(), 0}, {long_m, deep_m, high_m}, yaw_rad, dice.brightness(40, 110));
      const Eigen::Vector2d porch = loop.at(at + dice.between(-3, 3), aside_m - side * deep_m / 2);
      build.turned_box({porch.x(), porch.y(), 0}, {dice.between(1.5, 3), 2.2, dice.between(2.3, 3)}, yaw_rad, 60);
    }
  }
}

void tree(SceneBuilder& build, Dice& dice, const Eigen::Vector2d& at) {
  const Eigen::Vector3d foot{at.x(), at.y(), 0};
  const double height_m = dice.between(5, 11);
  build.cylinder(foot, dice.between(0.1, 0.25), 0.5 * height_m, 35);
  for (int i = 0; i < 7; ++i) {
    const double x = dice.between(-0.2, 0.2), y = dice.between(-0.2, 0.2), z = dice.between(0.4, 0.95);
    build.sphere(foot + height_m * Eigen::Vector3d{x, y, z}, dice.between(0.06, 0.13) * height_m, 40);
  }
}

void parked_car(SceneBuilder& build, Dice& dice, const Eigen::Vector2d& at, double yaw_rad) {
  const std::uint8_t bright = dice.brightness(20, 120);
  const double long_m = dice.between(3.8, 4.8), wide_m = dice.between(1.65, 1.85);
  build.turned_box({at.x(), at.y(), 0.2}, {long_m, wide_m, 0.7}, yaw_rad, bright);
  build.turned_box({at.x(), at.y(), 0.9}, {0.5 * long_m, wide_m - 0.2, 0.55}, yaw_rad, 15);
}

/// Adds poles and trees on both sides, parked cars on the outer one, and stretches of guard rail on the inner one.
void roadside(SceneBuilder& build, Furnishing& furnish, const Loop& loop, Dice& dice) {
  const auto upright = [](const Eigen::Vector2d& at) { return Eigen::Vector3d{at.x(), at.y(), 0}; };
  for (double at = 0; at < loop.length_m() - 10; at += dice.between(24, 34)) {
    build.cylinder(upright(loop.at(at, -kOuterEdge_m - 3)), 0.09, 7.5, 90);
    if (dice.chance(0.4)) { // a sign
      const Eigen::Vector2d post = loop.at(at + 9, kInnerEdge_m + 1);
      build.cylinder(upright(post), 0.04, 2.4, 100);
      build.turned_box({post.x(), post.y(), 2.4}, {0.04, 0.7, 0.7}, loop.heading_rad(at + 9), 200);
    }
  }
  for (double at = 5; at < loop.length_m() - 5; at += dice.between(9, 22)) {
    const bool outside = dice.chance(0.5);
    tree(build, dice,
         loop.at(at, outside ? -kOuterEdge_m - dice.between(4, 5) : kInnerEdge_m + dice.between(2.5, 4.5)));
  }
  for (double at = 2; at < loop.length_m() - 8; at += dice.between(5.5, 9)) {
    if (dice.chance(0.5))
      parked_car(build, dice, loop.at(at, -kOuterEdge_m - 1.3 + dice.between(-0.15, 0.15)), loop.heading_rad(at));
  }
  for (double at = 0; at < loop.length_m() - 60; at += dice.between(60, 140)) {
    const double to_m = at + dice.between(25, 55);
    for (double from_m = at; from_m < to_m; from_m += 6)
      furnish.railing(upright(loop.at(from_m, kInnerEdge_m + 0.5)), upright(loop.at(from_m + 6, kInnerEdge_m + 0.5)));
  }
}

/// Adds cars and vans that circulate, one behind the other.
void traffic(SceneBuilder& build, const Loop& loop, Dice& dice, double aside_m, double speed_mps) {
  constexpr double kStep_s = 0.1;
  const auto steps = static_cast<std::size_t>(loop.length_m() / std::abs(speed_mps) / kStep_s);
  std::vector<Place> places;
  for (std::size_t i = 0; i < steps; ++i) {
    const double along_m =
        std::copysign(static_cast<double>(i), speed_mps) * loop.length_m() / static_cast<double>(steps);
    const Eigen::Vector2d at = loop.at(along_m, aside_m);
    const double yaw_rad = loop.heading_rad(along_m) + (speed_mps < 0 ? std::numbers::pi : 0);
    places.push_back({{static_cast<float>(at.x()), static_cast<float>(at.y()), 0}, static_cast<float>(yaw_rad), 0});
  }
  const auto track = std::make_shared<const Track>(std::move(places), true);
  for (double at_s = 0; at_s < kStep_s * static_cast<double>(steps) - 10; at_s += dice.between(10, 24)) {
    const auto ahead = from_seconds(kStep_s * std::round(at_s / kStep_s));
    build.passer(Passer(dice.chance(0.25) ? Passer::Kind::van : Passer::Kind::car, track, Start{}.stamp - ahead));
  }
}

} // namespace

World make_road(std::uint64_t seed) {
  constexpr double kOthers_mps = 13.5, kOncoming_mps = 12;
  Dice dice(seed);
  Roads lanes = roads();
  const Loop loop;
  SceneBuilder build;
  Furnishing furnish(build, lanes, dice);
  ground(build, lanes, dice);
  houses(build, loop, dice);
  roadside(build, furnish, loop, dice);
  traffic(build, loop, dice, kLane_m, -kOncoming_mps);
  traffic(build, loop, dice, -2 * kLane_m, kOthers_mps);
  return {.scene = build.scene(),
          .roads = std::move(lanes),
          .ground_m = {},
          .terrain = {.height_m = 0.008, .tilt_rad = 0.003, .wavelength_m = 9},
          .max_speed_mps = 15};
}

} // namespace locus::sim

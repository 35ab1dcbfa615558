// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/company.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <optional>
#include <utility>

namespace locus::sim {
namespace {

constexpr double kStep_s = 0.1;
constexpr double kWalking_mps = 1.6, kFastest_mps = 1.75; // the latter to make way
constexpr double kStarting_mps2 = 3;
constexpr double kFarthest_m = 2.5;                 // from the robot's side
constexpr double kAbout_radps = 0.35;               // around the robot, at most
constexpr double kOffWalls_m = 0.3, kApart_m = 0.6; // kept from walls, and from each other
constexpr double kLost_m = 7;                       // farther away, a person is left behind
constexpr double kStride_m = 1.4, kSwing_rad = 0.45;

Eigen::Vector2d towards(double bearing_rad) { return {std::cos(bearing_rad), std::sin(bearing_rad)}; }

Eigen::Vector2d at_most(const Eigen::Vector2d& v, double norm) {
  return v.norm() > norm ? Eigen::Vector2d(norm / v.norm() * v) : v;
}

/// Simulates one person near the robot, step by step.
class Person {
 public:
  Person(const Scene& scene, const Way& way, Dice& dice)
      : scene_(scene), way_(way), dice_(dice),
        clear_m_(way.reach_m + kPersonalSpace_m + 0.03), // between two steps the distance may shrink a little
        strolls_(dice.chance(0.5)) {
    choose_bearing(0);
    bearing_rad_ = goal_rad_;
    at_m_ = wanted_place(0);
    yaw_rad_ = // NOLINT(cppcoreguidelines-prefer-member-initializer): random draw after choose_bearing()
        dice.between(-std::numbers::pi, std::numbers::pi);
    places_.reserve(way.steps());
    note(0);
  }

  void go(std::size_t step, const std::vector<Eigen::Vector2d>& others_m) {
    const Eigen::Vector2d last_m = at_m_;
    if (is_left_behind(step) && wait_farther_on(step)) {
      note(step);
      return;
    }
    velocity_mps_ += at_most(wanted_mps(step, others_m) - velocity_mps_, kStarting_mps2 * kStep_s);
    velocity_mps_ = at_most(velocity_mps_, kFastest_mps);
    at_m_ += kStep_s * velocity_mps_;
    stay_on_this_side(step);
    at_m_ = last_m + at_most(at_m_ - last_m, kFastest_mps * kStep_s);
    keep_clear(step);
    velocity_mps_ = at_most((at_m_ - last_m) / kStep_s, kFastest_mps);
    note(step);
  }

  [[nodiscard]] const Eigen::Vector2d& at_m() const { return at_m_; }
  std::vector<Place> places() && { return std::move(places_); }

 private:
  /// Returns the free distance from the robot in a direction, at knee and at chest height.
  [[nodiscard]] double free_m(std::size_t step, const Eigen::Vector2d& direction, double at_most_m) const {
    double free_m = at_most_m;
    for (const double height_m : {0.4, 1.1}) {
      const Eigen::Vector3d from = way_.ground_m[std::min(step, way_.steps() - 1)] + Eigen::Vector3d{0, 0, height_m};
      if (const auto hit = scene_.cast({from, {direction.x(), direction.y(), 0}}, free_m, way_.stamp(step)))
        free_m = hit->range_m;
    }
    return free_m;
  }

  /// Chooses another side of the robot, one with room.
  void choose_bearing(std::size_t step) {
    constexpr int kTries = 6;
    double best_m = -1;
    const double reach_rad = places_.empty() ? std::numbers::pi : strolls_ ? 2.0 : 0.4;
    for (int i = 0; i < kTries && best_m < clear_m_ + kOffWalls_m; ++i) {
      const double bearing = bearing_rad_ + dice_.between(-reach_rad, reach_rad) * (1 + 0.5 * i);
      if (const double room_m = free_m(step, towards(bearing), clear_m_ + kFarthest_m); room_m > best_m) {
        best_m = room_m;
        goal_rad_ = bearing;
      }
    }
    distance_m_ = clear_m_ + std::pow(dice_.between(0, 1), 2) * kFarthest_m; // mostly near
    chosen_until_s_ = kStep_s * static_cast<double>(step) + (strolls_ ? dice_.between(3, 8) : dice_.between(8, 20));
  }

  Eigen::Vector2d wanted_place(std::size_t step) {
    const double room_m = free_m(step, towards(bearing_rad_), distance_m_ + kOffWalls_m) - kOffWalls_m;
    if (room_m < clear_m_)
      choose_bearing(step);
    return way_.at(step) + std::clamp(room_m, clear_m_, distance_m_) * towards(bearing_rad_);
  }

  Eigen::Vector2d wanted_mps(std::size_t step, const std::vector<Eigen::Vector2d>& others_m) {
    const Eigen::Vector2d robot_mps = way_.velocity_mps(step);
    Eigen::Vector2d wanted = Eigen::Vector2d::Zero();
    waits_ = waits_ && (at_m_ - way_.at(step)).norm() > distance_m_;
    if (!waits_ && robot_mps.norm() < kWalking_mps) {
      if (kStep_s * static_cast<double>(step) > chosen_until_s_)
        choose_bearing(step);
      bearing_rad_ += std::clamp(goal_rad_ - bearing_rad_, -kAbout_radps * kStep_s, kAbout_radps * kStep_s);
      constexpr double kCatchUp_s = 1;
      wanted = robot_mps + (wanted_place(step) - at_m_) / kCatchUp_s;
    }
    for (const Eigen::Vector2d& other : others_m) {
      const Eigen::Vector2d away = at_m_ - other;
      if (const double gap_m = away.norm(); gap_m > 1e-6 && gap_m < kApart_m)
        wanted += (kApart_m - gap_m) / gap_m * 3 * away;
    }
    for (const std::size_t ahead : {5U, 10U}) { // steps: makes way before the robot comes
      const Eigen::Vector2d away = at_m_ - way_.at(step + ahead);
      if (const double gap_m = away.norm(); gap_m > 1e-6 && gap_m < clear_m_ + 0.1)
        wanted += (clear_m_ + 0.1 - gap_m) / gap_m * 3 * away;
    }
    return at_most(wanted, kWalking_mps);
  }

  void stay_on_this_side(std::size_t step) {
    const Eigen::Vector2d from_robot = at_m_ - way_.at(step);
    const double gap_m = from_robot.norm();
    if (gap_m < 1e-6)
      return;
    const double room_m = free_m(step, from_robot / gap_m, gap_m + kOffWalls_m) - kOffWalls_m;
    if (room_m < gap_m)
      at_m_ = way_.at(step) + std::max(room_m, clear_m_) / gap_m * from_robot;
  }

  void keep_clear(std::size_t step) {
    const Eigen::Vector2d from_robot = at_m_ - way_.at(step);
    if (const double gap_m = from_robot.norm(); gap_m < clear_m_)
      at_m_ = way_.at(step) + clear_m_ * (gap_m > 1e-6 ? Eigen::Vector2d(from_robot / gap_m) : towards(bearing_rad_));
  }

  [[nodiscard]] bool is_left_behind(std::size_t step) const {
    const Eigen::Vector2d from_robot = at_m_ - way_.at(step);
    return from_robot.norm() > kLost_m && !(waits_ && from_robot.dot(way_.velocity_mps(step)) > 0);
  }

  /// Places another person beside the path ahead of the robot. Returns false if there is no such place yet.
  bool wait_farther_on(std::size_t step) {
    constexpr double kAhead_m = 12, kAhead_s = 4;
    const double ahead_m = std::max(kAhead_m, kAhead_s * way_.velocity_mps(step).norm());
    std::size_t there = step;
    while (there < way_.steps() && (way_.at(there) - way_.at(step)).norm() < ahead_m)
      there += 5;
    if (there >= way_.steps() || there > step + 600)
      return false;
    const Eigen::Vector2d along = way_.velocity_mps(there), place = way_.at(there);
    if (along.norm() < 0.1)
      return false;
    const double side = dice_.chance(0.5) ? 1 : -1, aside_m = clear_m_ + dice_.between(0.1, 1.5);
    const Eigen::Vector2d left = side * Eigen::Vector2d{-along.y(), along.x()} / along.norm();
    if (free_m(there, left, aside_m + kOffWalls_m) < aside_m + kOffWalls_m)
      return false;
    const Eigen::Vector2d stands = place + aside_m * left;
    for (std::size_t i = step; i < std::min(there + 50, way_.steps()); i += 2)
      if ((stands - way_.at(i)).norm() < clear_m_ + 0.1)
        return false;
    at_m_ = stands;
    velocity_mps_.setZero();
    bearing_rad_ = goal_rad_ = std::atan2(left.y(), left.x());
    distance_m_ = aside_m;
    waits_ = true;
    return true;
  }

  /// Records the pose: facing the walking direction; a standing person shifts their weight.
  void note(std::size_t step) {
    const double speed_mps = velocity_mps_.norm();
    constexpr double kWalks_mps = 0.25, kTurning_radps = 2.5;
    if (speed_mps > kWalks_mps) {
      const double off =
          std::remainder(std::atan2(velocity_mps_.y(), velocity_mps_.x()) - yaw_rad_, 2 * std::numbers::pi);
      yaw_rad_ += std::clamp(off, -kTurning_radps * kStep_s, kTurning_radps * kStep_s);
    }
    stride_rad_ += 2 * std::numbers::pi * std::max(speed_mps / kStride_m, 0.15) * kStep_s;
    const double swing = kSwing_rad * std::clamp(speed_mps / kWalking_mps, 0.1, 1.0) * std::sin(stride_rad_);
    const Eigen::Vector2d shift = 0.04 * std::sin(0.31 * stride_rad_) * towards(yaw_rad_ + std::numbers::pi / 2);
    Eigen::Vector2d stands = at_m_ + (speed_mps > kWalks_mps ? Eigen::Vector2d::Zero().eval() : shift);
    const Eigen::Vector2d from_robot = stands - way_.at(step);
    if (from_robot.norm() < clear_m_)
      stands = at_m_;
    places_.push_back({way_.on_ground(stands).cast<float>(), static_cast<float>(yaw_rad_), static_cast<float>(swing)});
  }

  const Scene& scene_;
  const Way& way_;
  Dice& dice_;
  double clear_m_;         ///< from the robot's centre
  bool strolls_;           ///< around the robot; others stay on their side of it
  bool waits_ = false;     ///< until the robot comes
  double bearing_rad_ = 0; ///< desired position relative to the robot, like the next three
  double goal_rad_ = 0;
  double distance_m_ = 1;
  double chosen_until_s_ = 0;
  Eigen::Vector2d at_m_, velocity_mps_ = Eigen::Vector2d::Zero();
  double yaw_rad_ = 0, stride_rad_ = 0;
  std::vector<Place> places_;
};

} // namespace

Way::Way(const Trajectory& trajectory, double reach_m_, Ground height_m_)
    : begin(trajectory.start()), reach_m(reach_m_), height_m(std::move(height_m_)) {
  for (Stamp stamp = begin; stamp <= trajectory.end() + Track::kStep; stamp += Track::kStep)
    ground_m.push_back(on_ground(trajectory.T_world_base(stamp).translation.head<2>()));
}

Eigen::Vector2d Way::velocity_mps(std::size_t step) const {
  constexpr std::size_t kHalf = 5;
  const std::size_t from = step < kHalf ? 0 : step - kHalf;
  return (at(step + kHalf) - at(from)) / (kStep_s * static_cast<double>(step + kHalf - from));
}

Eigen::Vector3d Way::on_ground(const Eigen::Vector2d& place) const {
  return {place.x(), place.y(), height_m ? height_m(place.x(), place.y()).value : 0};
}

std::vector<Passer> company(const Scene& scene, const Way& way, std::size_t count, Dice& dice) {
  std::vector<Person> people;
  people.reserve(count);
  for (std::size_t i = 0; i < count; ++i)
    people.emplace_back(scene, way, dice);
  for (std::size_t step = 1; step < way.steps(); ++step) {
    for (Person& person : people) {
      std::vector<Eigen::Vector2d> others_m;
      for (const Person& other : people)
        if (&other != &person)
          others_m.push_back(other.at_m());
      person.go(step, others_m);
    }
  }
  std::vector<Passer> passers;
  passers.reserve(people.size());
  for (Person& person : people)
    passers.emplace_back(Passer::Kind::person, std::make_shared<Track>(std::move(person).places(), false), way.begin);
  return passers;
}

} // namespace locus::sim

// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/driver.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace locus::sim {
namespace {

constexpr double kStanding_s = 2;             // before the start and after the end, if time allows
constexpr double kOnSpot_rad = 1.8;           // sharper corners are turned on the spot
constexpr double kAside_m = 0.25;             // from the middle of a lane, at most
constexpr double kWeave_m = 12, kWeave_s = 8; // longer lanes are not driven straight

/// Walks from place to place, along the least used lane.
class Walk {
 public:
  Walk(const Roads& roads, double cruise_mps, Dice& dice)
      : roads_(roads), straight_m_(std::max(kWeave_m, kWeave_s * cruise_mps)), dice_(dice), uses_(roads.lanes().size()),
        here_(dice.below(roads.places_m().size())), position_m_(roads.places_m()[here_]) {}

  /// Returns the next point to drive to: a place, or an intermediate point.
  Eigen::Vector2d next() {
    if (on_the_way_.empty())
      choose();
    position_m_ = on_the_way_.back();
    on_the_way_.pop_back();
    return position_m_;
  }
  [[nodiscard]] const Eigen::Vector2d& position_m() const { return position_m_; }

 private:
  void choose() {
    std::size_t best = 0;
    double least = 1e9;
    for (std::size_t i = 0; i < roads_.lanes().size(); ++i) {
      const Roads::Lane& lane = roads_.lanes()[i];
      if (lane.from != here_ && lane.to != here_)
        continue;
      const bool back = i == last_lane_ && last_lane_ != kNone;
      const double weight = static_cast<double>(uses_[i]) + dice_.between(0, 0.9) + (back ? 100 : 0);
      if (weight < least) {
        least = weight;
        best = i;
      }
    }
    ++uses_[best];
    last_lane_ = best;
    const Roads::Lane& lane = roads_.lanes()[best];
    const Eigen::Vector2d from = roads_.places_m()[here_];
    here_ = lane.from == here_ ? lane.to : lane.from;
    append_way(from, roads_.places_m()[here_]);
  }

  void append_way(const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
    const Eigen::Vector2d along = to - from, left = Eigen::Vector2d{-along.y(), along.x()}.normalized();
    const auto parts = static_cast<int>(std::max(1.0, along.norm() / straight_m_));
    for (int i = parts; i >= 1; --i) {
      const Eigen::Vector2d on_line = from + along * (static_cast<double>(i) / parts);
      on_the_way_.emplace_back(on_line + dice_.between(-kAside_m, kAside_m) * left);
    }
  }

  static constexpr std::size_t kNone = static_cast<std::size_t>(-1);
  const Roads& roads_;
  double straight_m_; ///< longest straight section
  Dice& dice_;
  std::vector<int> uses_; ///< per lane
  std::size_t here_;
  std::size_t last_lane_ = kNone;
  Eigen::Vector2d position_m_;
  std::vector<Eigen::Vector2d> on_the_way_; ///< in reverse order
};

/// Drives a leg between the turns at its ends: accelerates, cruises, decelerates.
class Leg {
 public:
  Leg(double length_m, double from_mps, double to_mps, const Agility& agility, Dice& dice) : to_mps_(to_mps) {
    const auto pull = [&] {
      return dice.chance(agility.sudden_share) ? agility.sudden_mps2 : agility.acceleration_mps2;
    };
    const double up = pull(), down = pull();
    const double reachable =
        std::sqrt((2 * up * down * length_m + down * from_mps * from_mps + up * to_mps * to_mps) / (up + down));
    cruise_mps_ = std::max({std::min(agility.cruise_mps * dice.between(0.7, 1), reachable), from_mps, to_mps});
    rise_s_ = (cruise_mps_ - from_mps) / up;
    fall_s_ = (cruise_mps_ - to_mps) / down;
    const double changing_m = rise_s_ * (from_mps + cruise_mps_) / 2 + fall_s_ * (cruise_mps_ + to_mps) / 2;
    straight_m_ = std::max(0.0, length_m - changing_m);
  }

  [[nodiscard]] double duration_s() const { return rise_s_ + straight_m_ / cruise_mps_ + fall_s_; }
  void drive(Course& course) const {
    course.change_speed(cruise_mps_, from_seconds(rise_s_)).straight(straight_m_);
    course.change_speed(to_mps_, from_seconds(fall_s_));
  }

 private:
  double to_mps_, cruise_mps_, rise_s_, fall_s_, straight_m_;
};

double duration_s(const Course& course) {
  double sum_s = 0;
  for (const Course::Stretch& stretch : course.stretches())
    sum_s += stretch.duration_s;
  return sum_s;
}

/// Corner with its speed and turn rate.
struct Corner {
  double angle_rad;
  double speed_mps, rate_radps;

  /// Returns the distance from the start of the turn to the corner.
  [[nodiscard]] double kept_m() const { return speed_mps > 0 ? tangent_m(speed_mps, angle_rad, rate_radps) : 0; }
};

/// Returns a corner for slow driving: gentle ones at speed, sharp ones slowly, the sharpest on the spot.
Corner slow_corner(double angle_rad, const Agility& agility) {
  const double sharpness = std::abs(angle_rad);
  const double share = sharpness > kOnSpot_rad ? 0 : sharpness < 0.3 ? 0.65 : 0.4;
  return {angle_rad, share * agility.cruise_mps, agility.turn_rate_radps};
}

/// Returns a corner as fast as the legs before and behind it allow, less the parts that the turns need.
Corner fast_corner(double angle_rad, double before_m, double behind_m, double from_mps, const Agility& agility) {
  constexpr double kSharp_rad = 1.0, kSlower = 0.9;
  Corner corner{angle_rad, std::abs(angle_rad) > kSharp_rad ? 0 : agility.cruise_mps, agility.turn_rate_radps};
  for (; corner.speed_mps > 0.5; corner.speed_mps *= kSlower) {
    corner.rate_radps = std::min(agility.turn_rate_radps, agility.cornering_mps2 / corner.speed_mps);
    const double kept_m = corner.kept_m();
    const double reached_mps = std::sqrt(from_mps * from_mps + 2 * agility.acceleration_mps2 * (before_m - kept_m));
    const double stops_from_mps = std::sqrt(2 * agility.acceleration_mps2 * (behind_m - 2 * kept_m));
    if (before_m > kept_m && behind_m > 2 * kept_m && corner.speed_mps <= std::min(reached_mps, stops_from_mps))
      return corner;
  }
  return {angle_rad, 0, agility.turn_rate_radps};
}

/// Drives the longest leg that ends at rest in time, if one is worthwhile.
void drive_last_leg(Course& course, double longest_m, double from_mps, const Agility& agility, double left_s,
                    Dice& dice) {
  constexpr double kWorthIt_m = 0.5;
  const double braking_s = from_mps / agility.acceleration_mps2, braking_m = braking_s * from_mps / 2;
  for (double length_m = longest_m; length_m > braking_m + kWorthIt_m; length_m *= 0.9) {
    Dice same = dice;
    const Leg leg(length_m, from_mps, 0, agility, same);
    if (leg.duration_s() < left_s) {
      leg.drive(course);
      return;
    }
  }
  course.change_speed(0, from_seconds(braking_s));
}

} // namespace

PlannedCourse plan_course(const Roads& roads, const Agility& agility, Duration duration, Dice& dice) {
  Walk walk(roads, agility.cruise_mps, dice);
  PlannedCourse planned;
  Course& course = planned.course;
  const double standing_s = std::min(kStanding_s, to_seconds(duration) / 4);
  const double drive_until_s = to_seconds(duration) - standing_s;
  course.stand(from_seconds(standing_s));

  Eigen::Vector2d at = walk.position_m(), to = walk.next();
  planned.start.position_m = at;
  planned.start.heading_rad = std::atan2(to.y() - at.y(), to.x() - at.x());
  double speed_mps = 0, used_m = 0;
  while (true) {
    const Eigen::Vector2d leg = to - at, next = walk.next();
    const double angle_rad = angle_between(leg, next - to);
    const bool stops = dice.chance(agility.halts.share);
    Corner corner = agility.cornering_mps2 > 0
                        ? fast_corner(angle_rad, leg.norm() - used_m, (next - to).norm(), speed_mps, agility)
                        : slow_corner(angle_rad, agility);
    if (stops)
      corner = {angle_rad, 0, agility.turn_rate_radps};
    const double kept_m = corner.kept_m();
    const double length_m = leg.norm() - used_m - kept_m;
    Dice before = dice;
    const Leg driven(length_m, speed_mps, corner.speed_mps, agility, dice);
    const double turning_s = std::abs(angle_rad) / corner.rate_radps + 0.5;
    const double braking_s = corner.speed_mps / agility.acceleration_mps2;
    if (duration_s(course) + driven.duration_s() + turning_s + braking_s > drive_until_s) {
      drive_last_leg(course, length_m, speed_mps, agility, drive_until_s - duration_s(course), before);
      break;
    }
    driven.drive(course);
    if (stops)
      course.stand(from_seconds(dice.between(0.5, agility.halts.longest_s)));
    course.turn(angle_rad, corner.rate_radps);
    speed_mps = corner.speed_mps;
    used_m = kept_m;
    at = to;
    to = next;
  }
  course.stand(std::max(Duration::zero(), duration - from_seconds(duration_s(course))));
  return planned;
}

} // namespace locus::sim

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <vector>

#include "core/base/stamp.hpp"

namespace locus::sim {

/// What the driver does, step after step: speed and turning rate go from one value to the next along a quintic that
/// starts and ends flat, so the trajectory has a continuous acceleration and jerk everywhere.
class Course {
 public:
  Course& stand(Duration duration);
  Course& change_speed(double to_mps, Duration over);
  Course& straight(double distance_m);                    ///< at the present speed, which must not be zero
  Course& turn(double angle_rad, double peak_rate_radps); ///< at the present speed; at speed zero, on the spot
  /// From a standstill: turns about on the spot, drives all of it the other way and turns about again, to end where and
  /// as it began.
  Course& back(double peak_rate_radps);

  struct Pace {
    double speed_mps = 1.0;
    double turn_rate_radps = 1.0;
    Duration standing{2'000'000'000};     ///< before the start and after the end
    Duration accelerating{2'000'000'000}; ///< and braking
  };
  /// Along a polyline, its corners rounded by turns at the pace's speed. Starts at the first point, heading for the
  /// second. Throws std::invalid_argument when a leg is too short for the turns at its ends.
  static Course along(const std::vector<Eigen::Vector2d>& waypoints_m, const Pace& pace);

  /// One stretch of time over which speed and yaw rate pass from one value to another.
  struct Stretch {
    double duration_s;
    double from_mps, to_mps;
    double from_radps, to_radps;
  };
  [[nodiscard]] const std::vector<Stretch>& stretches() const { return stretches_; }

 private:
  std::vector<Stretch> stretches_;
  double speed_mps_ = 0;
};

/// From the corner of a polyline to where the turn around it begins and ends.
double tangent_m(double speed_mps, double angle_rad, double peak_rate_radps);

/// Signed angle from one direction to another, to the left.
double angle_between(const Eigen::Vector2d& from, const Eigen::Vector2d& to);

} // namespace locus::sim

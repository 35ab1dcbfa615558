// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <vector>

#include "core/base/stamp.hpp"

namespace locus::sim {

/// Sequence of the driver's actions: speed and turn rate follow a quintic from one value to the next, flat at both
/// ends, so that the trajectory has continuous acceleration and jerk.
class Course {
 public:
  Course& stand(Duration duration);
  Course& change_speed(double to_mps, Duration over);
  Course& straight(double distance_m);                    ///< at the current speed, which must not be zero
  Course& turn(double angle_rad, double peak_rate_radps); ///< at the current speed; at speed zero, on the spot
  /// Returns to the start, from a standstill: turns on the spot, drives everything the other way and turns again, to
  /// end in the initial pose.
  Course& back(double peak_rate_radps);

  struct Pace {
    double speed_mps = 1.0;
    double turn_rate_radps = 1.0;
    Duration standing{2'000'000'000};     ///< before the start and after the end
    Duration accelerating{2'000'000'000}; ///< and decelerating
  };
  /// Follows a polyline with rounded corners, at the speed of `pace`. Starts at the first point, heading for the
  /// second. Throws std::invalid_argument if a leg is too short for the turns at its ends.
  static Course along(const std::vector<Eigen::Vector2d>& waypoints_m, const Pace& pace);

  /// Interval over which speed and yaw rate change from one value to another.
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

/// Returns the distance from the corner of a polyline to the start and end of the turn around it.
double tangent_m(double speed_mps, double angle_rad, double peak_rate_radps);

/// Returns the signed angle between two directions, positive to the left.
double angle_between(const Eigen::Vector2d& from, const Eigen::Vector2d& to);

} // namespace locus::sim

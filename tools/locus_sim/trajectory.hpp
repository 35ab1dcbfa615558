// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <vector>

#include "core/pose.hpp"
#include "core/stamp.hpp"

namespace locus::sim {

/// What the driver does, step after step: speed and turning rate go from one value to the next along a quintic that
/// starts and ends flat, so the trajectory has a continuous acceleration and jerk everywhere.
class Course {
 public:
  Course& stand(Duration duration);
  Course& change_speed(double to_mps, Duration over);
  Course& straight(double distance_m);                    ///< at the present speed, which must not be zero
  Course& turn(double angle_rad, double peak_rate_radps); ///< at the present speed; at speed zero, on the spot

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

/// Where a course begins.
struct Start {
  Stamp stamp = stamp_from_ns(1'700'000'000'000'000'000); ///< 13 min 20 s past an hour
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();
  double heading_rad = 0;
};

/// Uneven ground: height and tilt of the base as functions of the distance driven, so a robot that stands is still.
struct Terrain {
  double height_m = 0;     ///< amplitude
  double tilt_rad = 0;     ///< amplitude of roll and of pitch
  double wavelength_m = 4; ///< of the longest ripple
};

/// The state of the base at one instant.
struct BaseMotion {
  Pose T_world_base;
  Eigen::Vector3d velocity_world_mps;
  Eigen::Vector3d acceleration_world_mps2;
  Eigen::Vector3d angular_velocity_base_radps;
};

/// The exact motion of a robot that drives a course: a continuous function of time with its derivatives. The base rolls
/// where it points (no sideways slip in the plane). Before the start and after the end it stands. Immutable, any
/// thread.
class Trajectory {
 public:
  explicit Trajectory(const Course& course, const Start& start = {}, const Terrain& terrain = {});

  [[nodiscard]] BaseMotion at(Stamp stamp) const;
  [[nodiscard]] Pose T_world_base(Stamp stamp) const { return at(stamp).T_world_base; }
  [[nodiscard]] Stamp start() const { return start_; }
  [[nodiscard]] Stamp end() const { return start_ + from_seconds(stretches_.back().begin_s); }
  [[nodiscard]] double length_m() const { return stretches_.back().driven_m; }

 private:
  /// A stretch with the state at its beginning, and the position at equal steps within it, between which it is
  /// integrated.
  struct Placed {
    Course::Stretch stretch;
    double begin_s;
    double driven_m;
    double heading_rad;
    double step_s;
    std::vector<Eigen::Vector2d> positions_m;
  };
  struct Planar {
    double driven_m, speed_mps, acceleration_mps2;
    double heading_rad, yaw_rate_radps, yaw_acceleration_radps2;
  };
  static Planar planar(const Placed& placed, double since_s);
  static Eigen::Vector2d displacement(const Placed& placed, double from_s, double to_s);

  Stamp start_;
  Terrain terrain_;
  std::vector<Placed> stretches_; ///< the last one is the standstill after the end
};

} // namespace locus::sim

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <functional>
#include <vector>

#include "core/base/pose.hpp"
#include "core/base/stamp.hpp"
#include "locus_sim/course.hpp"
#include "locus_sim/jet.hpp"

namespace locus::sim {

/// Initial pose and time of a course.
struct Start {
  Stamp stamp = stamp_from_ns(1'700'000'000'000'000'000); ///< 13 min 20 s past an hour
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();
  double heading_rad = 0;
};

/// Uneven ground: height and tilt of the base as functions of the distance driven, so that a robot at rest is still.
struct Terrain {
  double height_m = 0;     ///< amplitude
  double tilt_rad = 0;     ///< amplitude of roll and of pitch
  double wavelength_m = 4; ///< of the longest ripple
};

/// Height of the ground at a position, metres.
using Ground = std::function<Jet(const Jet& x_m, const Jet& y_m)>;

/// Oscillation of the body while the robot moves: a step of a gait, or a vibration.
struct Oscillation {
  double frequency_hz;
  Eigen::Vector3d amplitude_m;       ///< forward, left, up
  Eigen::Vector3d amplitude_rpy_rad; ///< roll, pitch, yaw
  double phase_rad = 0;              ///< each axis lags the preceding one by a third of a turn
};

/// Wheels, or feet, continue but the robot does not move; from and to after the start.
struct Slip {
  Duration from, to;
};

/// Rotation of the body about its own forward, left and up axes, and back: a person who carries it looks around. The
/// peak rate is 1.875 times the mean.
struct Flick {
  Duration from;                ///< after the start
  Duration there;               ///< one way; the return takes as long
  Eigen::Vector3d turn_rpy_rad; ///< roll, pitch, yaw
};

/// Motion of the body on its wheels or legs.
struct Ride {
  double base_height_m = 0; ///< of the base above the ground
  Ground ground_m = {};     ///< below the ripples of the terrain; none: level at 0
  std::vector<Oscillation> oscillations = {};
  std::vector<Slip> slips = {};   ///< sorted, not overlapping
  std::vector<Flick> flicks = {}; ///< sorted, not overlapping
};

/// State of the base at one instant.
struct BaseMotion {
  Pose T_world_base;
  Eigen::Vector3d velocity_world_mps;
  Eigen::Vector3d acceleration_world_mps2;
  Eigen::Vector3d angular_velocity_base_radps;
};

/// Exact motion of a robot that drives a course: a continuous function of time with its derivatives. The base moves in
/// its heading direction (no sideways slip in the plane, except for oscillations). Before the start and after the end
/// it stands. Immutable, any thread.
class Trajectory {
 public:
  explicit Trajectory(const Course& course, const Start& start = {}, const Terrain& terrain = {}, Ride ride = {});

  [[nodiscard]] BaseMotion at(Stamp stamp) const;
  [[nodiscard]] Pose T_world_base(Stamp stamp) const { return at(stamp).T_world_base; }
  /// Returns the share of the wheels' rotation that is lost: 0 they roll, 1 they spin on the spot.
  [[nodiscard]] double slip_ratio(Stamp stamp) const;
  [[nodiscard]] Stamp start() const { return start_; }
  [[nodiscard]] Stamp end() const;
  [[nodiscard]] double length_m() const { return stretches_.back().driven_m; }

 private:
  /// Stretch with the state at its start, and positions at equal steps within it, from which motion is integrated.
  struct Placed {
    Course::Stretch stretch;
    double begin_s;
    double driven_m;
    double heading_rad;
    double step_s;
    std::vector<Eigen::Vector2d> positions_m;
  };
  /// Motion in the plane, as a function of the time on the course, which pauses while the wheels slip.
  struct Planar {
    double driven_m, speed_mps, acceleration_mps2, jerk_mps3;
    double heading_rad, yaw_rate_radps, yaw_acceleration_radps2, yaw_jerk_radps3;
  };
  struct Attitude {
    Jet z_m, roll_rad, pitch_rad;
  };
  struct Swing {
    std::array<Jet, 3> shift_m;  ///< forward, left, up
    std::array<Jet, 3> turn_rad; ///< roll, pitch, yaw
  };
  static Planar planar(const Placed& placed, double since_s);
  static Eigen::Vector2d displacement(const Placed& placed, double from_s, double to_s);
  void add_flick(Swing& sum, double since_start_s) const;
  [[nodiscard]] Jet time_on_course(double since_start_s) const;
  [[nodiscard]] Attitude on_ground(const Jet& x, const Jet& y, const Jet& heading, const Jet& driven) const;
  [[nodiscard]] Swing swing(double since_start_s, const Jet& speed, const Jet& yaw_rate) const;

  Stamp start_;
  Terrain terrain_;
  Ride ride_;
  std::vector<Placed> stretches_; ///< last one: the standstill after the end
};

} // namespace locus::sim

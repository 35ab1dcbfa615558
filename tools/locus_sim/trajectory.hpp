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

/// Height of the ground at a place, metres.
using Ground = std::function<Jet(const Jet& x_m, const Jet& y_m)>;

/// One way in which the body swings while the robot moves: a step of a gait, or a vibration.
struct Oscillation {
  double frequency_hz;
  Eigen::Vector3d amplitude_m;       ///< forward, left, up
  Eigen::Vector3d amplitude_rpy_rad; ///< roll, pitch, yaw
  double phase_rad = 0;              ///< each axis is a third of a turn behind the one before
};

/// The wheels, or feet, run on as before but the robot does not move; from and to after the start.
struct Slip {
  Duration from, to;
};

/// The body is turned, about its own forward, left and up, by as much as this and back again: someone who carries it
/// looks round. At its fastest that is 1.875 times the mean.
struct Flick {
  Duration from;                ///< after the start
  Duration there;               ///< to get there, and as long to get back
  Eigen::Vector3d turn_rpy_rad; ///< roll, pitch, yaw
};

/// How the body rides on its wheels or legs.
struct Ride {
  double base_height_m = 0; ///< of the base above the ground
  Ground ground_m = {};     ///< what the wheels stand on, beneath the ripples of the terrain; none: level at 0
  std::vector<Oscillation> oscillations = {};
  std::vector<Slip> slips = {};   ///< in order, apart from each other
  std::vector<Flick> flicks = {}; ///< the same
};

/// The state of the base at one instant.
struct BaseMotion {
  Pose T_world_base;
  Eigen::Vector3d velocity_world_mps;
  Eigen::Vector3d acceleration_world_mps2;
  Eigen::Vector3d angular_velocity_base_radps;
};

/// The exact motion of a robot that drives a course: a continuous function of time with its derivatives. The base rolls
/// where it points (no sideways slip in the plane, but for oscillations). Before the start and after the end it stands.
/// Immutable, any thread.
class Trajectory {
 public:
  explicit Trajectory(const Course& course, const Start& start = {}, const Terrain& terrain = {}, Ride ride = {});

  [[nodiscard]] BaseMotion at(Stamp stamp) const;
  [[nodiscard]] Pose T_world_base(Stamp stamp) const { return at(stamp).T_world_base; }
  /// How much of what the wheels turn is lost: 0 they roll, 1 they spin on the spot.
  [[nodiscard]] double slip_ratio(Stamp stamp) const;
  [[nodiscard]] Stamp start() const { return start_; }
  [[nodiscard]] Stamp end() const;
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
  /// On the plane, as functions of the time on the course, which stands still while the wheels slip.
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
  std::vector<Placed> stretches_; ///< the last one is the standstill after the end
};

} // namespace locus::sim

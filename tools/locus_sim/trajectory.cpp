// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/trajectory.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>

namespace locus::sim {
namespace {

constexpr double kTurnRamp_s = 0.25;    // from straight to the full rate of a turn
constexpr double kLongestStep_s = 0.05; // three Gauss points over it are exact to 1e-12 m at 2 rad/s and 15 m/s

/// Quintic from 0 at u = 0 to 1 at u = 1, flat to the second order at both ends, with its slope and its integral from
/// 0.
double ease(double u) { return u * u * u * (10 + u * (-15 + 6 * u)); }
double ease_slope(double u) { return 30 * u * u * (1 - u) * (1 - u); }
double ease_integral(double u) { return u * u * u * u * (2.5 + u * (-3 + u)); }

/// Height, roll or pitch at a distance driven, with two derivatives by distance.
struct Ripple {
  double value, slope, curvature;
};

/// Two waves whose lengths have no common multiple, so that no two places feel the same.
Ripple ripple(double amplitude, double wavelength_m, double phase, double driven_m) {
  Ripple sum{};
  for (const double shortening : {1.0, std::numbers::phi}) {
    const double k = 2 * std::numbers::pi * shortening / wavelength_m;
    const double share = 0.5 * amplitude, angle = k * driven_m + phase * shortening;
    sum.value += share * std::sin(angle);
    sum.slope += share * k * std::cos(angle);
    sum.curvature -= share * k * k * std::sin(angle);
  }
  return sum;
}

Eigen::Vector2d unit(double heading_rad) { return {std::cos(heading_rad), std::sin(heading_rad)}; }

Course turning(double speed_mps, double angle_rad, double rate_radps) {
  return Course{}.change_speed(speed_mps, Duration::zero()).turn(angle_rad, rate_radps);
}

/// From the corner of a polyline to where the turn around it begins and ends.
double tangent_m(double speed_mps, double angle_rad, double rate_radps) {
  if (std::abs(angle_rad) < 1e-9)
    return 0;
  const Trajectory turn{turning(speed_mps, angle_rad, rate_radps)};
  return turn.T_world_base(turn.end()).translation.y() / std::sin(angle_rad);
}

double angle_between(const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  return std::atan2(from.x() * to.y() - from.y() * to.x(), from.dot(to));
}

} // namespace

Course& Course::stand(Duration duration) {
  if (speed_mps_ != 0)
    throw std::invalid_argument("Course::stand: brake to a speed of zero first");
  stretches_.push_back({to_seconds(duration), 0, 0, 0, 0});
  return *this;
}

Course& Course::change_speed(double to_mps, Duration over) {
  stretches_.push_back({to_seconds(over), speed_mps_, to_mps, 0, 0});
  speed_mps_ = to_mps;
  return *this;
}

Course& Course::straight(double distance_m) {
  if (!(distance_m >= 0 && speed_mps_ > 0))
    throw std::invalid_argument("Course::straight: needs a speed above zero and a distance of at least zero");
  stretches_.push_back({distance_m / speed_mps_, speed_mps_, speed_mps_, 0, 0});
  return *this;
}

Course& Course::turn(double angle_rad, double peak_rate_radps) {
  const double largest_rate = std::abs(angle_rad) / kTurnRamp_s; // a small turn is over before the peak is reached
  const double rate = std::copysign(std::min(peak_rate_radps, largest_rate), angle_rad);
  const double v = speed_mps_;
  stretches_.push_back({kTurnRamp_s, v, v, 0, rate});
  stretches_.push_back({rate == 0 ? 0 : angle_rad / rate - kTurnRamp_s, v, v, rate, rate});
  stretches_.push_back({kTurnRamp_s, v, v, rate, 0});
  return *this;
}

Course Course::along(const std::vector<Eigen::Vector2d>& waypoints_m, const Pace& pace) {
  if (waypoints_m.size() < 2)
    throw std::invalid_argument("Course::along: needs two waypoints or more");
  const double ramp_m = pace.speed_mps * to_seconds(pace.accelerating) / 2;
  Course course;
  course.stand(pace.standing).change_speed(pace.speed_mps, pace.accelerating);
  double used_m = ramp_m;
  for (std::size_t i = 1; i < waypoints_m.size(); ++i) {
    const Eigen::Vector2d leg = waypoints_m[i] - waypoints_m[i - 1];
    const bool last = i + 1 == waypoints_m.size();
    const double angle = last ? 0 : angle_between(leg, waypoints_m[i + 1] - waypoints_m[i]);
    const double kept_m = last ? ramp_m : tangent_m(pace.speed_mps, angle, pace.turn_rate_radps);
    const double straight_m = leg.norm() - used_m - kept_m;
    if (!(straight_m >= 0))
      throw std::invalid_argument("Course::along: the leg to waypoint " + std::to_string(i) +
                                  " is too short for the turns at its ends");
    course.straight(straight_m);
    if (!last)
      course.turn(angle, pace.turn_rate_radps);
    used_m = kept_m;
  }
  return course.change_speed(0, pace.accelerating).stand(pace.standing);
}

Trajectory::Trajectory(const Course& course, const Start& start, const Terrain& terrain)
    : start_(start.stamp), terrain_(terrain) {
  double begin_s = 0, driven_m = 0, heading_rad = start.heading_rad;
  Eigen::Vector2d position_m = start.position_m;
  for (const Course::Stretch& stretch : course.stretches()) {
    const double steps = std::max(1.0, std::ceil(stretch.duration_s / kLongestStep_s));
    Placed placed{stretch, begin_s, driven_m, heading_rad, stretch.duration_s / steps, {position_m}};
    for (double step = 0; step < steps; ++step)
      placed.positions_m.push_back(placed.positions_m.back() +
                                   displacement(placed, step * placed.step_s, (step + 1) * placed.step_s));
    const Planar end = planar(placed, stretch.duration_s);
    begin_s += stretch.duration_s;
    driven_m = end.driven_m;
    heading_rad = end.heading_rad;
    position_m = placed.positions_m.back();
    if (stretch.duration_s > 0)
      stretches_.push_back(std::move(placed));
  }
  stretches_.push_back({{1, 0, 0, 0, 0}, begin_s, driven_m, heading_rad, 1, {position_m}});
}

Trajectory::Planar Trajectory::planar(const Placed& placed, double since_s) {
  const auto& [duration_s, from_mps, to_mps, from_radps, to_radps] = placed.stretch;
  const double u = duration_s > 0 ? std::clamp(since_s / duration_s, 0.0, 1.0) : 0;
  const double gain_mps = to_mps - from_mps, gain_radps = to_radps - from_radps;
  return {.driven_m = placed.driven_m + from_mps * since_s + gain_mps * duration_s * ease_integral(u),
          .speed_mps = from_mps + gain_mps * ease(u),
          .acceleration_mps2 = duration_s > 0 ? gain_mps * ease_slope(u) / duration_s : 0,
          .heading_rad = placed.heading_rad + from_radps * since_s + gain_radps * duration_s * ease_integral(u),
          .yaw_rate_radps = from_radps + gain_radps * ease(u),
          .yaw_acceleration_radps2 = duration_s > 0 ? gain_radps * ease_slope(u) / duration_s : 0};
}

/// Gauss-Legendre quadrature of the velocity with three points.
Eigen::Vector2d Trajectory::displacement(const Placed& placed, double from_s, double to_s) {
  struct Node {
    double place, weight;
  };
  static constexpr std::array<Node, 3> kNodes{
      {{0.5 - 0.3872983346207417, 5.0 / 18}, {0.5, 8.0 / 18}, {0.5 + 0.3872983346207417, 5.0 / 18}}};
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const Node& node : kNodes) {
    const Planar state = planar(placed, from_s + node.place * (to_s - from_s));
    sum += node.weight * state.speed_mps * unit(state.heading_rad);
  }
  return (to_s - from_s) * sum;
}

BaseMotion Trajectory::at(Stamp stamp) const {
  const double t = to_seconds(stamp - start_);
  const auto after = std::upper_bound(stretches_.begin() + 1, stretches_.end(), t,
                                      [](double time_s, const Placed& placed) { return time_s < placed.begin_s; });
  const Placed& placed = *(after - 1);
  const double since_s = std::clamp(t - placed.begin_s, 0.0, placed.stretch.duration_s);
  const std::size_t steps = std::max<std::size_t>(placed.positions_m.size(), 2) - 1;
  const std::size_t step = std::min(static_cast<std::size_t>(since_s / placed.step_s), steps - 1);
  const double step_begin_s = static_cast<double>(step) * placed.step_s;
  const Eigen::Vector2d xy = placed.positions_m[step] + displacement(placed, step_begin_s, since_s);

  const Planar s = planar(placed, since_s);
  const double v = s.speed_mps, a = s.acceleration_mps2, yaw_rate = s.yaw_rate_radps;
  const Ripple z = ripple(terrain_.height_m, terrain_.wavelength_m, 0.0, s.driven_m);
  const Ripple roll = ripple(terrain_.tilt_rad, terrain_.wavelength_m, 1.0, s.driven_m);
  const Ripple pitch = ripple(terrain_.tilt_rad, terrain_.wavelength_m, 2.0, s.driven_m);
  const double roll_rate = roll.slope * v, pitch_rate = pitch.slope * v;
  const Eigen::Vector2d ahead = unit(s.heading_rad), left{-ahead.y(), ahead.x()};
  const Eigen::Vector2d velocity = v * ahead, acceleration = a * ahead + v * yaw_rate * left;
  const double cr = std::cos(roll.value), sr = std::sin(roll.value);
  const double cp = std::cos(pitch.value), sp = std::sin(pitch.value);

  BaseMotion motion;
  motion.T_world_base = {from_rpy_rad({roll.value, pitch.value, s.heading_rad}), {xy.x(), xy.y(), z.value}};
  motion.velocity_world_mps << velocity, z.slope * v;
  motion.acceleration_world_mps2 << acceleration, z.curvature * v * v + z.slope * a;
  // Rates of roll, pitch and yaw as seen in the base: the Euler-rate matrix of Rz(yaw) Ry(pitch) Rx(roll).
  motion.angular_velocity_base_radps = {roll_rate - yaw_rate * sp, pitch_rate * cr + yaw_rate * cp * sr,
                                        yaw_rate * cp * cr - pitch_rate * sr};
  return motion;
}

} // namespace locus::sim

// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/trajectory.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

namespace locus::sim {
namespace {

constexpr double kLongestStep_s = 0.05; // three Gauss points are exact to 1e-12 m at 2 rad/s and 15 m/s
constexpr double kHalfWheelbase_m = 0.3, kHalfTrack_m = 0.25;
constexpr double kSlipRamp_s = 0.3; // from rolling to spinning wheels

// Speeds from which the oscillation of the body has its full amplitude.
constexpr double kLively_mps = 0.2, kLively_radps = 0.5;

/// Sums two waves of incommensurable lengths, so that no two places are alike.
Jet ripple(double amplitude, double wavelength_m, double phase, const Jet& driven_m) {
  Jet sum;
  for (const double shortening : {1.0, std::numbers::phi})
    sum = sum +
          0.5 * amplitude * sin(2 * std::numbers::pi * shortening / wavelength_m * driven_m + Jet(phase * shortening));
  return sum;
}

Eigen::Vector2d unit(double heading_rad) { return {std::cos(heading_rad), std::sin(heading_rad)}; }

Jet squared(const Jet& x) { return x * x; }

double ramp_s(const Slip& slip) { return std::min(kSlipRamp_s, to_seconds(slip.to - slip.from) / 2); }

/// Returns the time lost to a slip so far, and its rate.
Jet time_lost(const Slip& slip, double since_start_s) {
  const double ramp = ramp_s(slip), middle = ramp / 2;
  return rising(Jet(since_start_s - to_seconds(slip.from) - middle, 1), ramp) -
         rising(Jet(since_start_s - to_seconds(slip.to) + middle, 1), ramp);
}

/// Converts coordinates and angles with their derivatives to position, attitude and their derivatives.
BaseMotion motion_of(const std::array<Jet, 3>& xyz_m, const Jet& roll, const Jet& pitch, const Jet& yaw) {
  const double cr = std::cos(roll.value), sr = std::sin(roll.value);
  const double cp = std::cos(pitch.value), sp = std::sin(pitch.value);
  const auto& [x, y, z] = xyz_m;
  BaseMotion motion;
  motion.T_world_base = {from_rpy_rad({roll.value, pitch.value, yaw.value}), {x.value, y.value, z.value}};
  motion.velocity_world_mps = {x.rate, y.rate, z.rate};
  motion.acceleration_world_mps2 = {x.acceleration, y.acceleration, z.acceleration};
  // Rates of roll, pitch and yaw in the base frame: the Euler-rate matrix of Rz(yaw) Ry(pitch) Rx(roll).
  motion.angular_velocity_base_radps = {roll.rate - yaw.rate * sp, pitch.rate * cr + yaw.rate * cp * sr,
                                        yaw.rate * cp * cr - pitch.rate * sr};
  return motion;
}

} // namespace

Trajectory::Trajectory(const Course& course, const Start& start, const Terrain& terrain, Ride ride)
    : start_(start.stamp), terrain_(terrain), ride_(std::move(ride)) {
  double begin_s = 0, driven_m = 0, heading_rad = start.heading_rad;
  Eigen::Vector2d position_m = start.position_m;
  for (const Course::Stretch& stretch : course.stretches()) {
    const double steps = std::max(1.0, std::ceil(stretch.duration_s / kLongestStep_s));
    Placed placed{stretch, begin_s, driven_m, heading_rad, stretch.duration_s / steps, {position_m}};
    for (double step = 0; step < steps; ++step)
      placed.positions_m.emplace_back(placed.positions_m.back() +
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

Stamp Trajectory::end() const {
  Stamp end = start_ + from_seconds(stretches_.back().begin_s);
  for (const Slip& slip : ride_.slips)
    end += slip.to - slip.from - from_seconds(ramp_s(slip));
  return end;
}

Trajectory::Planar Trajectory::planar(const Placed& placed, double since_s) {
  const auto& [duration_s, from_mps, to_mps, from_radps, to_radps] = placed.stretch;
  const double u = duration_s > 0 ? std::clamp(since_s / duration_s, 0.0, 1.0) : 0;
  const double gain_mps = to_mps - from_mps, gain_radps = to_radps - from_radps;
  const double slope = duration_s > 0 ? ease_slope(u) / duration_s : 0;
  const double curvature = duration_s > 0 ? ease_curvature(u) / (duration_s * duration_s) : 0;
  return {.driven_m = placed.driven_m + from_mps * since_s + gain_mps * duration_s * ease_integral(u),
          .speed_mps = from_mps + gain_mps * ease(u),
          .acceleration_mps2 = gain_mps * slope,
          .jerk_mps3 = gain_mps * curvature,
          .heading_rad = placed.heading_rad + from_radps * since_s + gain_radps * duration_s * ease_integral(u),
          .yaw_rate_radps = from_radps + gain_radps * ease(u),
          .yaw_acceleration_radps2 = gain_radps * slope,
          .yaw_jerk_radps3 = gain_radps * curvature};
}

/// Integrates the velocity by Gauss-Legendre quadrature with three points.
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

Jet Trajectory::time_on_course(double since_start_s) const {
  Jet time{since_start_s, 1, 0};
  for (const Slip& slip : ride_.slips)
    time = time - time_lost(slip, since_start_s);
  return time;
}

double Trajectory::slip_ratio(Stamp stamp) const { return 1 - time_on_course(to_seconds(stamp - start_)).rate; }

Trajectory::Attitude Trajectory::on_ground(const Jet& x, const Jet& y, const Jet& heading, const Jet& driven) const {
  Attitude attitude{.z_m = ride_.base_height_m + ripple(terrain_.height_m, terrain_.wavelength_m, 0.0, driven),
                    .roll_rad = ripple(terrain_.tilt_rad, terrain_.wavelength_m, 1.0, driven),
                    .pitch_rad = ripple(terrain_.tilt_rad, terrain_.wavelength_m, 2.0, driven)};
  if (!ride_.ground_m)
    return attitude;
  const Jet c = cos(heading), s = sin(heading);
  const auto height_at = [&](double ahead_m, double left_m) {
    return ride_.ground_m(x + ahead_m * c - left_m * s, y + ahead_m * s + left_m * c);
  };
  const Jet front = height_at(kHalfWheelbase_m, 0), back = height_at(-kHalfWheelbase_m, 0);
  const Jet left = height_at(0, kHalfTrack_m), right = height_at(0, -kHalfTrack_m);
  attitude.z_m = attitude.z_m + 0.25 * (front + back + left + right);
  attitude.pitch_rad = attitude.pitch_rad - atan((front - back) * (0.5 / kHalfWheelbase_m));
  attitude.roll_rad = attitude.roll_rad + atan((left - right) * (0.5 / kHalfTrack_m));
  return attitude;
}

Trajectory::Swing Trajectory::swing(double since_start_s, const Jet& speed, const Jet& yaw_rate) const {
  const Jet liveliness = saturated(squared(speed * (1 / kLively_mps)) + squared(yaw_rate * (1 / kLively_radps)));
  Swing sum;
  for (const Oscillation& oscillation : ride_.oscillations) {
    const double omega = 2 * std::numbers::pi * oscillation.frequency_hz;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double lag_rad = oscillation.phase_rad - 2 * std::numbers::pi / 3 * static_cast<double>(axis);
      const Jet wave = liveliness * sin(Jet(omega * since_start_s + lag_rad, omega));
      const auto i = static_cast<Eigen::Index>(axis);
      sum.shift_m[axis] = sum.shift_m[axis] + oscillation.amplitude_m[i] * wave;
      sum.turn_rad[axis] = sum.turn_rad[axis] + oscillation.amplitude_rpy_rad[i] * wave;
    }
  }
  add_flick(sum, since_start_s);
  return sum;
}

void Trajectory::add_flick(Swing& sum, double since_start_s) const {
  const auto after = std::upper_bound(ride_.flicks.begin(), ride_.flicks.end(), from_seconds(since_start_s),
                                      [](Duration since, const Flick& flick) { return since < flick.from; });
  if (after == ride_.flicks.begin())
    return;
  const Flick& flick = *(after - 1);
  const double rate = 1 / to_seconds(flick.there), phase = rate * (since_start_s - to_seconds(flick.from));
  const Jet share = ease(Jet(phase, rate)) - ease(Jet(phase - 1, rate));
  for (std::size_t axis = 0; axis < 3; ++axis)
    sum.turn_rad[axis] = sum.turn_rad[axis] + flick.turn_rpy_rad[static_cast<Eigen::Index>(axis)] * share;
}

BaseMotion Trajectory::at(Stamp stamp) const {
  const double since_start_s = to_seconds(stamp - start_);
  const Jet time = time_on_course(since_start_s);
  const auto after = std::upper_bound(stretches_.begin() + 1, stretches_.end(), time.value,
                                      [](double time_s, const Placed& placed) { return time_s < placed.begin_s; });
  const Placed& placed = *(after - 1);
  const double since_s = std::clamp(time.value - placed.begin_s, 0.0, placed.stretch.duration_s);
  const std::size_t steps = std::max<std::size_t>(placed.positions_m.size(), 2) - 1;
  const std::size_t step = std::min(static_cast<std::size_t>(since_s / placed.step_s), steps - 1);
  const double step_begin_s = static_cast<double>(step) * placed.step_s;
  const Eigen::Vector2d xy = placed.positions_m[step] + displacement(placed, step_begin_s, since_s);

  const Planar s = planar(placed, since_s);
  const Eigen::Vector2d ahead = unit(s.heading_rad), leftwards{-ahead.y(), ahead.x()};
  const Eigen::Vector2d velocity = s.speed_mps * ahead;
  const Eigen::Vector2d acceleration = s.acceleration_mps2 * ahead + s.speed_mps * s.yaw_rate_radps * leftwards;
  Jet x = chain(xy.x(), velocity.x(), acceleration.x(), time);
  Jet y = chain(xy.y(), velocity.y(), acceleration.y(), time);
  const Jet yaw = chain(s.heading_rad, s.yaw_rate_radps, s.yaw_acceleration_radps2, time);
  const Jet driven = chain(s.driven_m, s.speed_mps, s.acceleration_mps2, time);
  const auto [z, roll, pitch] = on_ground(x, y, yaw, driven);

  const Jet speed = chain(s.speed_mps, s.acceleration_mps2, s.jerk_mps3, time);
  const Jet yaw_rate = chain(s.yaw_rate_radps, s.yaw_acceleration_radps2, s.yaw_jerk_radps3, time);
  const auto [shift_m, turn_rad] = swing(since_start_s, speed, yaw_rate);
  const Jet c = cos(yaw), n = sin(yaw);
  x = x + shift_m[0] * c - shift_m[1] * n;
  y = y + shift_m[0] * n + shift_m[1] * c;
  return motion_of({x, y, z + shift_m[2]}, roll + turn_rad[0], pitch + turn_rad[1], yaw + turn_rad[2]);
}

} // namespace locus::sim

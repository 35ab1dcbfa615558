// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/course.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <stdexcept>
#include <string>

#include "locus_sim/trajectory.hpp"

namespace locus::sim {
namespace {

constexpr double kTurnRamp_s = 0.25; // from straight to the full turn rate

Course turning(double speed_mps, double angle_rad, double rate_radps) {
  return Course{}.change_speed(speed_mps, Duration::zero()).turn(angle_rad, rate_radps);
}

} // namespace

double tangent_m(double speed_mps, double angle_rad, double rate_radps) {
  if (std::abs(angle_rad) < 1e-9)
    return 0;
  const Trajectory turn{turning(speed_mps, angle_rad, rate_radps)};
  return turn.T_world_base(turn.end()).translation.y() / std::sin(angle_rad);
}

double angle_between(const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  return std::atan2(from.x() * to.y() - from.y() * to.x(), from.dot(to));
}

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
  const double largest_rate = std::abs(angle_rad) / kTurnRamp_s; // a small turn ends before the peak rate
  const double rate = std::copysign(std::min(peak_rate_radps, largest_rate), angle_rad);
  const double v = speed_mps_;
  stretches_.push_back({kTurnRamp_s, v, v, 0, rate});
  stretches_.push_back({rate == 0 ? 0 : angle_rad / rate - kTurnRamp_s, v, v, rate, rate});
  stretches_.push_back({kTurnRamp_s, v, v, rate, 0});
  return *this;
}

Course& Course::back(double peak_rate_radps) {
  if (speed_mps_ != 0)
    throw std::invalid_argument("Course::back: brake to a speed of zero first");
  const std::vector<Stretch> out = stretches_;
  turn(std::numbers::pi, peak_rate_radps);
  std::transform(out.rbegin(), out.rend(), std::back_inserter(stretches_), [](const Stretch& there) {
    return Stretch{there.duration_s, there.to_mps, there.from_mps, -there.to_radps, -there.from_radps};
  });
  return turn(std::numbers::pi, peak_rate_radps);
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

} // namespace locus::sim

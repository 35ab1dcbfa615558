// SPDX-License-Identifier: Apache-2.0
#include "daemon/fast_odometry.hpp"

#include <algorithm>

namespace locus::daemon {

namespace {

/// The twist is that over so long: an odometry source of 20 Hz has two samples in it.
constexpr Duration kTwistSpan = std::chrono::milliseconds{100};

/// Turn rate over the last kTwistSpan, rad/s in base axes; nothing where the track is too short.
std::optional<Eigen::Vector3d> turn_rate(const MotionSources& sources, const SourceChoice& choice, Stamp now) {
  const std::optional<Pose> T_then_now = sources.motion({choice.rotation, {}}, now - kTwistSpan, now);
  if (!T_then_now)
    return std::nullopt;
  return so3_log(T_then_now->rotation) / to_seconds(kTwistSpan);
}

/// Velocity over the kTwistSpan up to the last sample of a translation, m/s in base axes; nothing where no source tells
/// the translation.
std::optional<Eigen::Vector3d> velocity(const MotionSources& sources, const SourceChoice& choice, Stamp last) {
  const std::optional<Pose> T_then_now = sources.motion(choice, last - kTwistSpan, last);
  if (!choice.translation || !T_then_now)
    return std::nullopt;
  return se3_log(*T_then_now).head<3>() / to_seconds(kTwistSpan);
}

/// The error of the pose that was carried, and that of a twist which was off all the way: its turn takes effect
/// half-way on the mean, so that is where the twist is turned into odom axes and what its lever reaches from. Second
/// order in the turn of a sweep: 0.1 % at 1 rad/s.
Matrix6 carried_covariance(const FastSample& from, const Pose& T_odom_now, double elapsed_s) {
  const Pose T_from_now = from.T_odom_base.inverse() * T_odom_now;
  const Pose T_odom_half = from.T_odom_base * se3_exp(0.5 * se3_log(T_from_now));
  const Matrix6 of_pose = transport(T_odom_now.translation - from.T_odom_base.translation);
  const Matrix6 of_twist =
      elapsed_s * transport(T_odom_now.translation - T_odom_half.translation) * turn_both(T_odom_half.rotation);
  return of_pose * from.pose_covariance * of_pose.transpose() + of_twist * from.twist_covariance * of_twist.transpose();
}

} // namespace

std::optional<FastSample> FastOdometry::carry(const MotionSources& sources, SourceId source, Stamp arrival) const {
  const SourceChoice choice = sources.choose(arrival);
  const std::optional<Stamp> newest = sources.newest(source);
  if (!estimate_ || choice.rotation != source || !newest || *newest <= estimate_->stamp)
    return std::nullopt;
  const std::optional<Stamp> translated = choice.translation ? sources.newest(*choice.translation) : std::nullopt;
  const Stamp last = std::min(translated.value_or(estimate_->stamp), *newest);
  const Stamp measured = std::max(last, estimate_->stamp);
  const std::optional<Pose> T_estimate_measured = sources.motion(choice, estimate_->stamp, measured);
  const std::optional<Pose> T_measured_now = sources.motion({choice.rotation, {}}, measured, *newest);
  if (!T_estimate_measured || !T_measured_now)
    return std::nullopt;
  FastSample now = *estimate_;
  now.stamp = *newest;
  now.twist_base.head<3>() = velocity(sources, choice, last).value_or(estimate_->twist_base.head<3>());
  now.twist_base.tail<3>() = turn_rate(sources, choice, *newest).value_or(estimate_->twist_base.tail<3>());
  Vector6 arc;
  arc << to_seconds(*newest - measured) * now.twist_base.head<3>(), so3_log(T_measured_now->rotation);
  now.T_odom_base = estimate_->T_odom_base * *T_estimate_measured * se3_exp(arc);
  now.pose_covariance = carried_covariance(*estimate_, now.T_odom_base, to_seconds(*newest - estimate_->stamp));
  return now;
}

} // namespace locus::daemon

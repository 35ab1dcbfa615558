// SPDX-License-Identifier: Apache-2.0
#include "daemon/fast_odometry.hpp"

#include <algorithm>

namespace locus::daemon {

namespace {

/// Averaging window of the twist: two samples of a 20 Hz odometry source.
constexpr Duration kTwistSpan = std::chrono::milliseconds{100};

/// Returns the turn rate over the last kTwistSpan, rad/s in base axes; empty if the track is too short.
std::optional<Eigen::Vector3d> turn_rate(const MotionSources& sources, const SourceChoice& choice, Stamp now) {
  const std::optional<Pose> T_then_now = sources.motion({choice.rotation, {}}, now - kTwistSpan, now);
  if (!T_then_now)
    return std::nullopt;
  return so3_log(T_then_now->rotation) / to_seconds(kTwistSpan);
}

/// Returns the velocity over the kTwistSpan before the last translation sample, m/s in base axes; empty without a
/// translation source.
std::optional<Eigen::Vector3d> velocity(const MotionSources& sources, const SourceChoice& choice, Stamp last) {
  const std::optional<Pose> T_then_now = sources.motion(choice, last - kTwistSpan, last);
  if (!choice.translation || !T_then_now)
    return std::nullopt;
  return se3_log(*T_then_now).head<3>() / to_seconds(kTwistSpan);
}

/// Propagates the pose covariance and adds that of a constant twist error. The twist is rotated into odom axes, and its
/// lever arm measured, at the midpoint of the path, where the error acts on average. Second order in the rotation
/// during a sweep: 0.1 % at 1 rad/s.
Matrix6 predicted_covariance(const FastSample& from, const Pose& T_odom_now, double elapsed_s) {
  const Pose T_from_now = from.T_odom_base.inverse() * T_odom_now;
  const Pose T_odom_half = from.T_odom_base * se3_exp(0.5 * se3_log(T_from_now));
  const Matrix6 of_pose = transport(T_odom_now.translation - from.T_odom_base.translation);
  const Matrix6 of_twist =
      elapsed_s * transport(T_odom_now.translation - T_odom_half.translation) * turn_both(T_odom_half.rotation);
  return of_pose * from.pose_covariance * of_pose.transpose() + of_twist * from.twist_covariance * of_twist.transpose();
}

} // namespace

std::optional<FastSample> FastOdometry::predict(const MotionSources& sources, SourceId source, Stamp arrival) const {
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
  now.pose_covariance = predicted_covariance(*estimate_, now.T_odom_base, to_seconds(*newest - estimate_->stamp));
  return now;
}

} // namespace locus::daemon

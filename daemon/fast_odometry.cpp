// SPDX-License-Identifier: Apache-2.0
#include "daemon/fast_odometry.hpp"

namespace locus::daemon {

namespace {

/// The twist is that over so long: an odometry source of 20 Hz has two samples in it.
constexpr Duration kTwistSpan = std::chrono::milliseconds{100};

} // namespace

std::optional<FastSample> FastOdometry::carry(const MotionSources& sources, std::size_t source, Stamp arrival) const {
  const SourceChoice choice = sources.choose(arrival);
  const std::optional<Stamp> newest = sources.newest(source);
  if (!estimate_ || choice.rotation != source || !newest || *newest <= estimate_->stamp)
    return std::nullopt;
  const std::optional<Pose> T_estimate_now = sources.motion(choice, estimate_->stamp, *newest);
  if (!T_estimate_now)
    return std::nullopt;
  FastSample now = *estimate_;
  now.stamp = *newest;
  now.T_odom_base = estimate_->T_odom_base * *T_estimate_now;
  if (!choice.translation) // the gyro alone does not say how far: as fast as before
    now.T_odom_base.translation += estimate_->T_odom_base.rotation *
                                   (to_seconds(*newest - estimate_->stamp) * estimate_->twist_base.head<3>()).eval();
  if (const std::optional<Pose> T_then_now = sources.motion(choice, *newest - kTwistSpan, *newest)) {
    const Vector6 twist = se3_log(*T_then_now) / to_seconds(kTwistSpan);
    now.twist_base.tail<3>() = twist.tail<3>();
    if (choice.translation)
      now.twist_base.head<3>() = twist.head<3>();
  }
  const double elapsed_s = to_seconds(*newest - estimate_->stamp);
  now.pose_covariance += elapsed_s * elapsed_s * estimate_->twist_covariance;
  return now;
}

} // namespace locus::daemon

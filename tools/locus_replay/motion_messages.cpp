// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/motion_messages.hpp"

namespace locus::tools {

namespace ros = daemon::ros;

ros::Imu to_ros(const ImuSample& sample, const std::string& frame) {
  const Eigen::Vector3d& w = sample.angular_velocity_radps;
  const Eigen::Vector3d& f = sample.specific_force_mps2;
  ros::Imu message{};
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-const-cast): C types; the message is only read
  message.header_ = {daemon::to_ros(sample.stamp), const_cast<char*>(frame.c_str())};
  if (const auto& q = sample.attitude)
    message.orientation_ = {q->x(), q->y(), q->z(), q->w()};
  else
    message.orientation_covariance_[0] = -1; // REP 145: not available
  message.angular_velocity_ = {w.x(), w.y(), w.z()};
  message.linear_acceleration_ = {f.x(), f.y(), f.z()};
  return message;
}

ros::Odometry to_ros(const OdometrySample& sample, const daemon::FrameNames& frames) {
  constexpr double kUsualVariance = 1; // its logarithm is exactly 0, so that a usual one replays to the same bits
  daemon::OdometryReport report{.stamp = sample.stamp, .T_odom_base = sample.T_source_base};
  report.twist_covariance.diagonal().setConstant(kUsualVariance * sample.covariance_scale);
  return daemon::to_ros(report, frames);
}

} // namespace locus::tools

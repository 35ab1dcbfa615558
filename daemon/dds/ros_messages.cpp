// SPDX-License-Identifier: Apache-2.0
#include "daemon/dds/ros_messages.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "drivers/files/motion_rows.hpp"

namespace locus::daemon {
namespace {

/// Removes const for the C types; DDS only reads the strings of a message that it writes.
char* c_string(const std::string& text) { return const_cast<char*>(text.c_str()); } // NOLINT: see above

Eigen::Quaterniond to_eigen(const ros::Quaternion& q) { return {q.w_, q.x_, q.y_, q.z_}; }
Eigen::Vector3d to_eigen(const ros::Vector3& v) { return {v.x_, v.y_, v.z_}; }

/// Normalises a rotation. Preserves the digits of one that is normalised, so that a recording replays to the same bits.
Eigen::Quaterniond normalised(const Eigen::Quaterniond& q) {
  return unit_quaternion(q.w(), q.x(), q.y(), q.z()).value_or(q);
}

ros::Quaternion to_ros(const Eigen::Quaterniond& q) { return {q.x(), q.y(), q.z(), q.w()}; }

void copy_row_major(const Matrix6& matrix, std::span<double, 36> out) {
  const Eigen::Matrix<double, 6, 6, Eigen::RowMajor> rows = matrix;
  std::copy_n(rows.data(), out.size(), out.begin());
}

} // namespace

Stamp to_stamp(const ros::Time& time) { return Stamp{std::chrono::seconds{time.sec_} + Duration{time.nanosec_}}; }

ImuSample to_sample(const ros::Imu& message, Stamp arrival) {
  ImuSample sample{to_stamp(message.header_.stamp_), arrival, to_eigen(message.angular_velocity_),
                   to_eigen(message.linear_acceleration_), std::nullopt};
  const Eigen::Quaterniond attitude = to_eigen(message.orientation_);
  if (message.orientation_covariance_[0] != -1.0 && is_rotation(attitude))
    sample.attitude = normalised(attitude);
  return sample;
}

double UsualCovariance::scale(const ros::Odometry& message) {
  if (!is_moving(message))
    return 1.0;
  const Stamp stamp = to_stamp(message.header_.stamp_);
  const double scale = compare(message.twist_.covariance_);
  if (scale <= kMaxUsualRatio)
    unusual_since_.reset();
  else if (!unusual_since_ || stamp < *unusual_since_)
    unusual_since_ = stamp;
  else if (stamp - *unusual_since_ > kAdaptationTime) {
    axes_ = {};
    unusual_since_.reset();
    return compare(message.twist_.covariance_);
  }
  return scale;
}

/// Compares the axes of which both the present and the usual variance are known, and learns the present one.
double UsualCovariance::compare(std::span<const double, 36> twist_covariance) {
  double now = 0.0, usual = 0.0;
  bool lost_any = false;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    constexpr double kMemory = 6000.0; ///< samples: two minutes at 50 Hz
    constexpr double kUnknown = 1e3;   ///< 32 m/s or rad/s: drivers send 1e3 to DBL_MAX for what they do not know
    const double variance = twist_covariance[7 * i];
    Axis& axis = axes_[i];
    const bool is_known = variance > 0.0 && variance < kUnknown; // false for NaN
    lost_any = lost_any || (axis.samples > 0 && variance >= kUnknown);
    if (!is_known)
      continue;
    ++axis.samples;
    axis.log_usual += (std::log(variance) - axis.log_usual) / std::min(static_cast<double>(axis.samples), kMemory);
    now += variance;
    usual += std::exp(axis.log_usual);
  }
  if (usual > 0.0)
    return now / usual;
  return lost_any ? std::numeric_limits<double>::infinity() : 1.0;
}

/// Tells whether the robot clearly moves: by the twist or, for drivers that leave it zero, by the step since the
/// message before.
bool UsualCovariance::is_moving(const ros::Odometry& message) {
  constexpr double kMinSpeed_mps = 0.1, kMinTurnRate_radps = 0.1; ///< above what drivers take for rest
  const Stamp stamp = to_stamp(message.header_.stamp_);
  const auto& [p, q] = message.pose_.pose_;
  const Pose before = std::exchange(last_, Pose{to_eigen(q), {p.x_, p.y_, p.z_}});
  const double step_s = to_seconds(stamp - std::exchange(last_stamp_, stamp));
  const Eigen::Vector3d velocity_mps = to_eigen(message.twist_.twist_.linear_);
  const Eigen::Vector3d turn_rate_radps = to_eigen(message.twist_.twist_.angular_);
  if (!velocity_mps.isZero(0) || !turn_rate_radps.isZero(0))
    return velocity_mps.norm() > kMinSpeed_mps || turn_rate_radps.norm() > kMinTurnRate_radps;
  const double turned_rad = 2.0 * (last_.rotation.coeffs() - before.rotation.coeffs()).norm();
  return step_s > 0.0 && ((last_.translation - before.translation).norm() > kMinSpeed_mps * step_s ||
                          turned_rad > kMinTurnRate_radps * step_s);
}

OdometrySample to_sample(const ros::Odometry& message, Stamp arrival, UsualCovariance& usual) {
  const auto& [position, orientation] = message.pose_.pose_;
  const Eigen::Quaterniond rotation = to_eigen(orientation);
  return {to_stamp(message.header_.stamp_), arrival,
          Pose{is_rotation(rotation) ? normalised(rotation) : rotation, {position.x_, position.y_, position.z_}},
          usual.scale(message)};
}

OdometryReport report_of(const OdometryEstimate& e) {
  return {e.stamp, e.T_odom_base, e.pose_covariance, e.twist_base, e.twist_covariance};
}

ros::Time to_ros(Stamp stamp) {
  const auto seconds = std::chrono::floor<std::chrono::seconds>(stamp.time_since_epoch());
  return {static_cast<std::int32_t>(seconds.count()),
          static_cast<std::uint32_t>((stamp.time_since_epoch() - seconds).count())};
}

ros::Odometry to_ros(const OdometryReport& report, const FrameNames& frames) {
  const Eigen::Vector3d& p = report.T_odom_base.translation;
  const Vector6& v = report.twist_base;
  ros::Odometry message{};
  message.header_ = {to_ros(report.stamp), c_string(frames.odom)};
  message.child_frame_id_ = c_string(frames.base);
  message.pose_.pose_ = {{p.x(), p.y(), p.z()}, to_ros(report.T_odom_base.rotation)};
  copy_row_major(report.pose_covariance, message.pose_.covariance_);
  message.twist_.twist_ = {{v[0], v[1], v[2]}, {v[3], v[4], v[5]}};
  copy_row_major(report.twist_covariance, message.twist_.covariance_);
  return message;
}

ros::TransformStamped to_ros_transform(Stamp stamp, const Pose& T_odom_base, const FrameNames& frames) {
  const Eigen::Vector3d& p = T_odom_base.translation;
  return {{to_ros(stamp), c_string(frames.odom)},
          c_string(frames.base),
          {{p.x(), p.y(), p.z()}, to_ros(T_odom_base.rotation)}};
}

ros::UInt8 to_ros(TrackingState state) { return {static_cast<std::uint8_t>(state)}; }

CloudMessage::CloudMessage() {
  enum Datatype : std::uint8_t { kUint16 = 4, kFloat32 = 7 }; // of sensor_msgs/PointField
  static_assert(sizeof(Point) == 24 && std::endian::native == std::endian::little);
  const auto field = [this](const char* name, std::size_t offset, Datatype type) {
    fields_.push_back({const_cast<char*>(name), static_cast<std::uint32_t>(offset), type, 1}); // NOLINT: as c_string()
  };
  field("x", offsetof(Point, x_m), kFloat32);
  field("y", offsetof(Point, y_m), kFloat32);
  field("z", offsetof(Point, z_m), kFloat32);
  field("intensity", offsetof(Point, intensity), kFloat32);
  field("time", offsetof(Point, time_s), kFloat32);
  field("ring", offsetof(Point, ring), kUint16);
  field("lidar", offsetof(Point, lidar), kUint16);
}

const ros::PointCloud2& CloudMessage::make(std::span<const Point> points, Stamp stamp, const std::string& frame) {
  data_.resize(points.size_bytes());
  if (!points.empty())
    std::memcpy(data_.data(), points.data(), points.size_bytes());
  const auto count = static_cast<std::uint32_t>(points.size());
  const auto bytes = static_cast<std::uint32_t>(data_.size());
  const auto fields = static_cast<std::uint32_t>(fields_.size());
  message_.header_ = {to_ros(stamp), c_string(frame)};
  message_.height_ = 1;
  message_.width_ = count;
  message_.fields_ = {fields, fields, fields_.data(), false};
  message_.is_bigendian_ = false;
  message_.point_step_ = sizeof(Point);
  message_.row_step_ = bytes;
  message_.data_ = {bytes, bytes, data_.data(), false};
  message_.is_dense_ = true;
  return message_;
}

DiagnosticsMessage::DiagnosticsMessage(std::vector<Diagnostic> diagnostics, Stamp stamp)
    : diagnostics_(std::move(diagnostics)) {
  for (const Diagnostic& diagnostic : diagnostics_) {
    std::vector<ros::KeyValue>& values = values_.emplace_back();
    for (const auto& [key, value] : diagnostic.values)
      values.push_back({c_string(key), c_string(value)});
    const auto count = static_cast<std::uint32_t>(values.size());
    statuses_.push_back({static_cast<std::uint8_t>(diagnostic.level),
                         c_string(diagnostic.name),
                         c_string(diagnostic.message),
                         c_string(no_frame_),
                         {count, count, values.data(), false}});
  }
  const auto count = static_cast<std::uint32_t>(statuses_.size());
  message_.header_ = {to_ros(stamp), c_string(no_frame_)};
  message_.status_ = {count, count, statuses_.data(), false};
}

} // namespace locus::daemon

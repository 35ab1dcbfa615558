// SPDX-License-Identifier: Apache-2.0
#include "daemon/dds/ros_messages.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

namespace locus::daemon {
namespace {

/// Removes const for the C types; DDS only reads the strings of a message that it writes.
char* c_string(const std::string& text) { return const_cast<char*>(text.c_str()); } // NOLINT: see above

Eigen::Quaterniond to_eigen(const ros::Quaternion& q) { return {q.w_, q.x_, q.y_, q.z_}; }
Eigen::Vector3d to_eigen(const ros::Vector3& v) { return {v.x_, v.y_, v.z_}; }

/// Tells whether a quaternion has unit norm up to rounding; drivers without an attitude send zeros.
bool is_rotation(const Eigen::Quaterniond& q) {
  constexpr double kTolerance = 0.1;
  return std::abs(q.norm() - 1.0) < kTolerance; // false for NaN
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
    sample.attitude = attitude.normalized();
  return sample;
}

double UsualCovariance::scale(std::span<const double, 36> twist_covariance) {
  constexpr double kMemory = 6000.0; ///< samples: two minutes at 50 Hz
  double trace = 0.0;
  for (std::size_t i = 0; i < 6; ++i) {
    const double variance = twist_covariance[7 * i];
    if (!(variance >= 0.0 && std::isfinite(variance)))
      return std::numeric_limits<double>::infinity();
    trace += variance;
  }
  if (!(trace > 0.0 && std::isfinite(trace)))
    return trace > 0.0 ? std::numeric_limits<double>::infinity() : 1.0;
  ++samples_;
  log_usual_ += (std::log(trace) - log_usual_) / std::min(static_cast<double>(samples_), kMemory);
  return trace / std::exp(log_usual_);
}

OdometrySample to_sample(const ros::Odometry& message, Stamp arrival, UsualCovariance& usual) {
  const auto& [position, orientation] = message.pose_.pose_;
  return {to_stamp(message.header_.stamp_), arrival,
          Pose{to_eigen(orientation).normalized(), {position.x_, position.y_, position.z_}},
          usual.scale(std::span<const double, 36>(message.twist_.covariance_))};
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

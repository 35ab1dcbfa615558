// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/odometry/odometry_estimate.hpp"
#include "core/sources/motion_sample.hpp"
#include "daemon/dds/ros_types.hpp"

/// Between the messages of ROS 2 and the types of the core. Nothing here touches a network.
namespace locus::daemon {

/// A message from outside may hold anything: what is no number stays none and is left to the HealthMonitor, which
/// counts it. Any thread.
Stamp to_stamp(const ros::Time& time);

/// The attitude is taken only from a unit that has one, by the rules of REP 145: the first covariance is not -1, the
/// quaternion is one.
ImuSample to_sample(const ros::Imu& message, Stamp arrival);

/// Says how much worse than usual an odometry source is, from the covariance that it reports of its twist. That of its
/// pose will not do: it grows with the way that lies behind. One owner.
class UsualCovariance {
 public:
  /// 1 is as usual, or nothing reported; infinity is for a covariance that none can be.
  double scale(std::span<const double, 36> twist_covariance);

 private:
  double log_usual_ = 0.0;
  std::uint64_t samples_ = 0;
};

OdometrySample to_sample(const ros::Odometry& message, Stamp arrival, UsualCovariance& usual);

/// As the messages name the frames. Must outlive the messages made with it.
struct FrameNames {
  std::string odom, base;
};

/// What the odometry says of one instant, to whoever listens.
struct OdometryReport {
  Stamp stamp;
  Pose T_odom_base;
  Matrix6 pose_covariance = Matrix6::Zero();
  Vector6 twist_base = Vector6::Zero();
  Matrix6 twist_covariance = Matrix6::Zero();
};

OdometryReport report_of(const OdometryEstimate& estimate);

ros::Time to_ros(Stamp stamp);
ros::Odometry to_ros(const OdometryReport& report, const FrameNames& frames);
ros::TransformStamped to_ros_transform(Stamp stamp, const Pose& T_odom_base, const FrameNames& frames);
/// 0 tracking, 1 degenerate, 2 dead reckoning, 3 standstill.
ros::UInt8 to_ros(TrackingState state);

/// A cloud of points, with memory of its own that is used again. One owner.
///
/// Fields: x, y, z in metres; intensity as the lidar gave it, 0..255; time in seconds from the stamp of the cloud to
/// the firing, zero or less; ring, with the lowest laser 0; lidar, the index in the configuration. Little-endian.
class CloudMessage {
 public:
  struct Point {
    float x_m, y_m, z_m;
    float intensity;
    float time_s;
    std::uint16_t ring;
    std::uint16_t lidar;
  };

  CloudMessage();
  CloudMessage(const CloudMessage&) = delete;
  CloudMessage& operator=(const CloudMessage&) = delete;

  /// The message, valid until the next call. `frame` must live as long.
  const ros::PointCloud2& make(std::span<const Point> points, Stamp stamp, const std::string& frame);

 private:
  std::vector<ros::PointField> fields_;
  std::vector<std::uint8_t> data_;
  ros::PointCloud2 message_{};
};

/// One line of /diagnostics with its figures.
struct Diagnostic {
  enum class Level : std::uint8_t { ok = 0, warning = 1, error = 2, stale = 3 };
  Level level = Level::ok;
  std::string name;    ///< "locusd: front"
  std::string message; ///< in plain words
  std::vector<std::pair<std::string, std::string>> values;
};

/// Diagnostics as a message. One owner; lives as long as the message is used.
class DiagnosticsMessage {
 public:
  DiagnosticsMessage(std::vector<Diagnostic> diagnostics, Stamp stamp);
  DiagnosticsMessage(const DiagnosticsMessage&) = delete;
  DiagnosticsMessage& operator=(const DiagnosticsMessage&) = delete;
  [[nodiscard]] const ros::DiagnosticArray& message() const { return message_; }

 private:
  std::string no_frame_;
  std::vector<Diagnostic> diagnostics_;
  std::deque<std::vector<ros::KeyValue>> values_;
  std::vector<ros::DiagnosticStatus> statuses_;
  ros::DiagnosticArray message_{};
};

} // namespace locus::daemon

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/odometry/odometry_estimate.hpp"
#include "core/sources/motion_sample.hpp"
#include "daemon/dds/ros_types.hpp"

/// Conversion between ROS 2 messages and the types of the core, without network access.
namespace locus::daemon {

/// Converts a stamp. These functions do not validate external messages: NaN passes through and is rejected and counted
/// by the HealthMonitor. Any thread.
Stamp to_stamp(const ros::Time& time);

/// Converts an IMU message. The attitude is set only if the message has one by REP 145: the first orientation
/// covariance is not -1 and the quaternion has unit norm.
ImuSample to_sample(const ros::Imu& message, Stamp arrival);

/// Compares the reported twist covariance of an odometry source with its usual value. The pose covariance is
/// unsuitable, since it grows with the distance travelled.
///
/// Zero, negative, huge or no number means that the driver does not know the variance of this axis; it is then left
/// out. Variances at rest are not compared with those in motion, for many drivers report next to nothing at rest. What
/// remains unusual for ten seconds becomes the usual. One owner.
class UsualCovariance {
 public:
  static constexpr double kMaxUsualRatio = 4.0; ///< largest ratio that is nothing unusual: twice the standard deviation
  static constexpr Duration kAdaptationTime = std::chrono::seconds{10};

  /// Returns the ratio to the usual covariance; 1 at rest and if none is reported, infinity if all that was reported
  /// before is now huge.
  double scale(const ros::Odometry& message);

 private:
  struct Axis {
    double log_usual = 0.0;
    std::uint64_t samples = 0;
  };

  double compare(std::span<const double, 36> twist_covariance);
  bool is_moving(const ros::Odometry& message);

  std::array<Axis, 6> axes_{};
  std::optional<Stamp> unusual_since_;
  Pose last_;
  Stamp last_stamp_;
};

/// Converts an odometry message. A quaternion that is no rotation is passed on as it is, for the HealthMonitor to
/// count.
OdometrySample to_sample(const ros::Odometry& message, Stamp arrival, UsualCovariance& usual);

/// Frame names in messages. Must outlive the messages created with it.
struct FrameNames {
  std::string odom, base;
};

/// Odometry output for one instant.
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
/// Converts the state: 0 tracking, 1 degenerate, 2 dead reckoning, 3 standstill.
ros::UInt8 to_ros(TrackingState state);

/// PointCloud2 message with reusable memory. One owner.
///
/// Fields: x, y, z in metres; intensity as reported by the lidar, 0..255; time in seconds from the stamp of the cloud
/// to the firing, zero or less; ring, with the lowest laser 0; lidar, the index in the configuration. Little-endian.
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

  /// Returns the message, valid until the next call. `frame` must live as long.
  const ros::PointCloud2& make(std::span<const Point> points, Stamp stamp, const std::string& frame);

 private:
  std::vector<ros::PointField> fields_;
  std::vector<std::uint8_t> data_;
  ros::PointCloud2 message_{};
};

/// Entry of /diagnostics with its values.
struct Diagnostic {
  enum class Level : std::uint8_t { ok = 0, warning = 1, error = 2, stale = 3 };
  Level level = Level::ok;
  std::string name;    ///< "locusd: front"
  std::string message; ///< text for the user
  std::vector<std::pair<std::string, std::string>> values;
};

/// DiagnosticArray message. One owner; must outlive the use of message().
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

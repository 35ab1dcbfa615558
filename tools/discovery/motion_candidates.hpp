// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "config/config_proposal.hpp"
#include "core/base/stamp.hpp"
#include "daemon/dds/ros_messages.hpp"

namespace locus::tools {

/// Extent of a motion beyond the noise of an odometry that stands.
inline constexpr double kMoves_m = 0.5;

/// Topic of a sensor_msgs/Imu or a nav_msgs/Odometry, in a recording or on a network, as its messages show it.
struct MotionCandidate {
  std::string topic;
  SourceKind kind;
  std::string frame;            ///< of an IMU; of the body whose motion an odometry reports (child_frame_id)
  std::size_t messages = 0;     ///< examined
  std::size_t later = 0;        ///< of these, received after the first: messages may be received in groups
  std::optional<Stamp> first{}; ///< reception of the first and of the latest message
  Stamp latest{};
  double force_sum_mps2 = 0;                       ///< of an IMU: magnitudes of the specific forces
  std::optional<Eigen::Vector3d> first_position{}; ///< of an odometry
  double extent_m = 0;                             ///< of an odometry: farthest from its first position

  void add(const daemon::ros::Imu& message, Stamp received);
  void add(const daemon::ros::Odometry& message, Stamp received);

  [[nodiscard]] double rate_hz() const; ///< 0 for fewer than two messages
  [[nodiscard]] double mean_force_mps2() const;
  [[nodiscard]] bool is_too_slow() const;      ///< of an IMU: not used at this rate, see HealthMonitor::is_too_slow()
  [[nodiscard]] bool measures_gravity() const; ///< in m/s^2, as ROS requires
  [[nodiscard]] bool moves() const { return extent_m >= kMoves_m; }
  /// Describes it for a comment: "sensor_msgs/Imu, 100 Hz, measures 9.8 m/s^2, as gravity at rest".
  [[nodiscard]] std::string text() const;

 private:
  void count(Stamp received);
};

/// Assigns topics to the first motion source of each kind in the configuration. Of several candidates for one source it
/// uses the first in this order, and lists the others with the reason in `reasons`:
///
/// - IMU: fast enough to be used; on the usual topic; in a frame that `is_placed` on the robot; that measures gravity
/// in
///   m/s^2; with most messages.
/// - odometry: that moves; not named after lidar or truth, whose errors it would repeat; on the usual topic; of the
///   base; with most messages.
///
/// Does nothing for a kind without candidates.
void choose_sources(std::vector<MotionCandidate> candidates, const std::function<bool(const std::string&)>& is_placed,
                    Config& config, ConfigReasons& reasons);

} // namespace locus::tools

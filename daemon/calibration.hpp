// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "core/base/options.hpp"
#include "core/odometry/motion_filter.hpp"
#include "daemon/figures.hpp"
#include "daemon/odometry_comparison.hpp"

namespace locus::daemon {

/// Formats a mounting as in the configuration. Any thread.
nlohmann::ordered_json mounting_json(const Pose& T_base_sensor);

/// Returns T_base_source of an IMU whose turns `gyro_axes` maps to those of the base; nothing if no mounting does.
/// `gyro_axes`: HealthMonitor::gyro_axes(). Any thread.
std::optional<Pose> mounting_with(const MotionSourceOptions& imu, const std::optional<Eigen::Matrix3d>& gyro_axes);

/// Returns the comparison of an odometry with lidar, with the whole lateness: that which its configuration removes is
/// included. Empty for an IMU and before the first sweep. Any thread.
std::optional<OdometryFindings> findings_on(const Figures& figures, std::size_t source);

/// Returns the learned calibration of a motion source beside its configuration, each figure with its standard deviation
/// and the configured one. `late_ms`: the delay of a stamp relative to the motion that it measures; of an odometry from
/// `compared`. IMU: `mounting_deg`, the rotation error of T_base_source about the x, y and z axes of the base.
/// Odometry: `scale` and `yaw_scale`, the reported distance per metre ahead and the reported angle per radian of yaw.
/// `calibrated` holds the configuration keys whose learned value is better known than the configured one, with that
/// value. Unless its samples were played `in_time`, an IMU is `too_late` if its delay exceeds what a live run can
/// compensate (MotionTrack::applied_lateness()): its figures are wrong by more than their deviation, and `calibrated`
/// is empty. Any thread.
nlohmann::ordered_json learned_json(const MotionSourceOptions& source, const LearnedSource& learned,
                                    bool in_time = false, const std::optional<OdometryFindings>& compared = {});

/// Returns the configuration of a source, updated by each learned figure that is better known than the configured one
/// and differs from it by three standard deviations. Any thread.
MotionSourceOptions calibrated(const MotionSourceOptions& source, const LearnedSource& learned,
                               const std::optional<OdometryFindings>& compared = {});

/// Rotation of all lidars against their configured mounting, see OdometryFindings::lidar_turn_rad.
struct LidarTurn {
  std::size_t source = 0; ///< odometry that determines it best
  std::array<Learned, 3> rad;
};
/// Returns nothing without an odometry that calibrates. Any thread.
std::optional<LidarTurn> turn_of_lidars(const std::vector<MotionSource>& sources,
                                        const std::array<std::optional<OdometryFindings>, kMaxSources>& compared);

/// Returns the part of the rotation that is better known than the configuration, about each axis of the base; zero
/// about the others. Any thread.
Eigen::Vector3d known_turn_rad(const LidarTurn& turn);

/// Returns the rotation of the lidars about those axes of the base about which lidar determines the mounting of an IMU:
/// there the IMU was observed relative to them. Any thread.
Eigen::Vector3d observed_part(Eigen::Vector3d turn_rad, const MotionSourceOptions& imu, const LearnedSource& learned);

/// Returns the learned mounting of a lidar beside its configuration, in the form of learned_json(). Any thread.
nlohmann::ordered_json learned_json(const LidarOptions& lidar, const LidarTurn& turn);

/// Formats `calibrated` of all sources and lidars for a configuration file; both as in summary.json. Any thread.
std::string calibration_yaml(const nlohmann::ordered_json& sources, const nlohmann::ordered_json& lidars = {});

/// Formats the figures of all sources and lidars as a table. Any thread.
std::string calibration_text(const nlohmann::ordered_json& sources, const nlohmann::ordered_json& lidars = {});

/// Describes a significant, large error in the mounting of the lidars, as a sentence. Empty if there is no such error.
/// Any thread.
std::string lidar_mounting_warning(const Figures& figures);

/// Describes a significant, large error in the stamps of the source with this index or in the mounting or the axes of
/// an IMU, and the remedy; phrased to follow the name of the source. Whether the source or the lidar is at fault is
/// unknown, unless lidar_mounting_warning() describes the same rotation: then this is empty, as without such an error.
/// Any thread.
std::string calibration_warning(const Figures& figures, std::size_t source);

} // namespace locus::daemon

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "core/base/options.hpp"
#include "core/odometry/motion_filter.hpp"
#include "daemon/figures.hpp"

namespace locus::daemon {

/// Returns the learned calibration of a motion source beside its configuration, each figure with its standard deviation
/// and the configured one. IMU: `late_ms`, the delay of a stamp relative to the motion that it measures, and
/// `mounting_deg`, the rotation error of T_base_source about the x, y and z axes of the base. Odometry: `scale` and
/// `yaw_scale`, the reported distance per metre ahead and the reported angle per radian of yaw. `calibrated` holds the
/// configuration keys whose learned value is better known than the configured one, with that value. Unless its samples
/// were played `in_time`, an IMU is `too_late` if its delay exceeds what a live run can compensate
/// (MotionTrack::applied_lateness()): its figures are wrong by more than their deviation, and `calibrated` is empty.
/// Any thread.
nlohmann::ordered_json learned_json(const MotionSourceOptions& source, const LearnedSource& learned,
                                    bool in_time = false);

/// Returns the configuration of a source, updated by each learned figure that is better known than the configured one
/// and differs from it by three standard deviations. Any thread.
MotionSourceOptions calibrated(const MotionSourceOptions& source, const LearnedSource& learned);

/// Formats `calibrated` of all sources for a configuration file; `sources` as in summary.json. Any thread.
std::string calibration_yaml(const nlohmann::ordered_json& sources);

/// Formats the figures of all sources as a table. Any thread.
std::string calibration_text(const nlohmann::ordered_json& sources);

/// Describes a significant, large error in the stamps or the mounting of the IMU with this index, and the remedy;
/// phrased to follow the name of the source. Whether the IMU or the lidar is at fault is unknown. Empty if there is no
/// such error. Any thread.
std::string calibration_warning(const Figures& figures, std::size_t source);

} // namespace locus::daemon

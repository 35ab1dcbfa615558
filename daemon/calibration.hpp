// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "core/base/options.hpp"
#include "core/odometry/motion_filter.hpp"
#include "daemon/figures.hpp"

namespace locus::daemon {

/// What the estimator has learned of a motion source against its configuration, each figure with its standard
/// deviation and the configured one: of an IMU `late_ms` (by how much a sample is stamped after the motion that it
/// tells of) and `mounting_deg` (by which turn about x, y and z of the base it sits otherwise than T_base_source says);
/// of an odometry `scale` and `yaw_scale` (what it reports of a metre ahead and of a radian of yaw). `calibrated` has
/// the keys of the configuration, with their values, that are known better than they are configured. Unless its samples
/// were played `in_time`, an IMU that is later than a drive can take out of its stamps (MotionTrack::taken_out()) is
/// `too_late`: what is told of it is wrong by more than its deviation, and `calibrated` has none of it. Any thread.
nlohmann::ordered_json learned_json(const MotionSourceOptions& source, const LearnedSource& learned,
                                    bool in_time = false);

/// The configuration of a source with what is plainly known better, by three standard deviations, taken in. Any thread.
MotionSourceOptions calibrated(const MotionSourceOptions& source, const LearnedSource& learned);

/// For configuration files: `calibrated` of all sources, of `sources` as in summary.json. Any thread.
std::string calibration_yaml(const nlohmann::ordered_json& sources);

/// For people: a table of the figures of all sources. Any thread.
std::string calibration_text(const nlohmann::ordered_json& sources);

/// What is plainly and grossly wrong with the stamps or the mounting of the source of this index, an IMU, to stand
/// behind its name: what, and what to do. Which of it and lidar is wrong is not known; empty where nothing is. Any
/// thread.
std::string calibration_doubt(const Figures& figures, std::size_t source);

} // namespace locus::daemon

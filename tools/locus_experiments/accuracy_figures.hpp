// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "drivers/files/motion_files.hpp"

namespace locus::experiments {

/// Collects the page's figures of a run on the recording `name` from the files in `folder`: {"summary", "sources",
/// "imus": names of the sources with samples and of the inertial ones among them, "receiver", "states", "claims",
/// "way": {"way_m", "percent", "deg_per_100m"} of way_drift() if there is truth, "warnings"}. Throws tools::Failure.
nlohmann::ordered_json recording_figures(const std::string& name, const std::filesystem::path& folder,
                                         const std::filesystem::path& recording);

/// Returns the sources that a finished run received.
std::vector<std::string> received_sources(const nlohmann::ordered_json& summary);

/// Filters the names of sources of kind imu, by the configuration that locus-replay uses.
std::vector<std::string> imus_among(std::vector<std::string> names, const std::filesystem::path& recording);

/// Formats a message of locus-replay as a line for a page: about the recording, without the program name or local
/// paths.
std::string readable(const std::string& message, const std::string& name, const std::filesystem::path& recording);

/// Derives the motion reported by a run without truth: {"poses", "farthest_at_first_m", "farthest_m",
/// "most_turned_deg", "speed_mps": {"median", "max"}}: distance from the first pose, within half a second and ever, and
/// speed between poses (null with fewer than two).
nlohmann::ordered_json claims_of(const std::vector<StampedPose>& trajectory);

/// Returns {"fixes", "min_mps", "median_mps", "max_mps"} of the satellite receiver at the lidar, whose sentences are in
/// the position packets of a capture or capture folder; null without receiver, fix or speed.
nlohmann::ordered_json receiver_speed(const std::filesystem::path& recording);

/// Returns the true poses of a recording: gt.tum of a capture folder, the inertial unit of a drive of KITTI; empty if
/// there are none. Throws tools::Failure.
std::vector<StampedPose> truth_of(const std::filesystem::path& recording);

} // namespace locus::experiments

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "drivers/files/motion_files.hpp"

namespace locus::experiments {

/// What the page shows of a run on a recording of this name, by the files that it has left in `folder`: {"summary",
/// "sources", "imus": names of the sources that said something and of the inertial ones among them, "receiver",
/// "states", "claims", "way": {"way_m", "percent", "deg_per_100m"} of way_drift() where there is truth, "warnings"}.
/// Throws tools::Failure.
nlohmann::ordered_json recording_figures(const std::string& name, const std::filesystem::path& folder,
                                         const std::filesystem::path& recording);

/// What locus-replay said, as a line for a page: of the recording, with neither the program nor where on this machine
/// it lies.
std::string readable(const std::string& said, const std::string& name, const std::filesystem::path& recording);

/// What a run of locus-replay says where no truth contradicts: {"poses", "farthest_at_first_m", "farthest_m",
/// "most_turned_deg", "speed_mps": {"median", "max"}}: from the first pose, within half a second and ever, and from
/// pose to pose (null with fewer than two).
nlohmann::ordered_json claims_of(const std::vector<StampedPose>& trajectory);

/// {"fixes", "min_mps", "median_mps", "max_mps"} by the satellite receiver at the lidar, whose sentences stand in the
/// position packets of a capture or capture folder; null where there is none, none has a fix, or it tells no speed.
nlohmann::ordered_json receiver_speed(const std::filesystem::path& recording);

/// True poses that belong to a recording: gt.tum of a capture folder, the inertial unit of a drive of KITTI. Empty
/// where there are none. Throws tools::Failure.
std::vector<StampedPose> truth_of(const std::filesystem::path& recording);

} // namespace locus::experiments

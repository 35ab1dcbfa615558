// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace locus::experiments {

/// Something that locus-replay takes for a recording, by its name: whether it can be read is for locus-replay to say.
struct FoundRecording {
  std::string name; ///< its path in the folder that was searched; of a place that is a recording itself, its own name
  std::filesystem::path where;
};

/// What to look for, for a user who has none of it.
inline constexpr const char* kKindsOfRecordings =
    "*.pcap, *.pcapng, folders with lidar.pcap, bags of ROS 1 (*.bag) or ROS 2 (*.mcap, *.db3), drives of KITTI "
    "(velodyne_points/data)";

/// All recordings in these folders, at any depth, in the order of their names. A place may be a recording itself. What
/// lies in `output` is left out. Throws tools::Failure for a place that is not there.
std::vector<FoundRecording> find_recordings(const std::vector<std::filesystem::path>& places,
                                            const std::filesystem::path& output);

} // namespace locus::experiments

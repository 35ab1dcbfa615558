// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace locus::experiments {

/// Recording as recognised by name; locus-replay determines whether it is readable.
struct FoundRecording {
  std::string name; ///< path relative to the folder searched; for a place that is a recording itself, its own name
  std::filesystem::path where;
};

/// Supported kinds, for a user without any recording.
inline constexpr const char* kKindsOfRecordings =
    "*.pcap, *.pcapng, folders with lidar.pcap, bags of ROS 1 (*.bag) or ROS 2 (*.mcap, *.db3), drives of KITTI "
    "(velodyne_points/data)";

/// Finds all recordings in these folders, at any depth, sorted by name. A place may be a recording itself. Skips
/// `output`. Throws tools::Failure for a place that does not exist.
std::vector<FoundRecording> find_recordings(const std::vector<std::filesystem::path>& places,
                                            const std::filesystem::path& output);

} // namespace locus::experiments

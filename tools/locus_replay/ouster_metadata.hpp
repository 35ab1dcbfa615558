// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "drivers/files/capture_folder.hpp"

namespace locus::tools {

/// Result of the search for metadata.
struct FoundMetadata {
  std::string used;                  ///< origin of the metadata in use, for the user; empty if none
  std::vector<std::string> warnings; ///< a line each
};

/// Searches for the metadata of the Ouster in a capture or a bag, and configures the first lidar accordingly: in a bag
/// its topic `metadata`, as ouster-ros publishes it; else a file named after the recording (drive.json or drive_0.json
/// for drive.pcap), else the only .json file beside it that matches packets of the recording. For default
/// configurations; does nothing if the configuration names an Ouster, or if its first lidar gives clouds.
FoundMetadata find_metadata(const CaptureFolder& folder, Config& config);

/// Returns whether find_metadata() finds metadata for a bag.
bool has_metadata(const std::filesystem::path& bag);

/// Makes the Ousters of a recording by locusd use the metadata recorded with it.
void use_recorded_metadata(const CaptureFolder& folder, Config& config);

} // namespace locus::tools

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "config/config.hpp"
#include "drivers/files/capture_folder.hpp"

namespace locus::tools {

/// Result of the search for metadata.
struct FoundMetadata {
  std::string taken;                 ///< file in use, for the user; empty if none
  std::vector<std::string> warnings; ///< a line each
};

/// Searches next to a pcap capture for the metadata of its Ouster, and configures the first lidar accordingly: a file
/// named after the capture (drive.json or drive_0.json for drive.pcap), else the only .json file that matches packets
/// of the capture. For default configurations; does nothing if the configuration names an Ouster.
FoundMetadata find_metadata(const CaptureFolder& folder, Config& config);

/// Makes the Ousters of a recording by locusd use the metadata recorded with it.
void use_recorded_metadata(const CaptureFolder& folder, Config& config);

} // namespace locus::tools

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "config/config.hpp"
#include "drivers/files/capture_folder.hpp"

namespace locus::tools {

/// What looking for metadata has found.
struct FoundMetadata {
  std::string taken;                 ///< which file was, for the user; empty for none
  std::vector<std::string> warnings; ///< a line each
};

/// Looks beside a pcap capture for the metadata of the Ouster that it is of, and makes the first lidar that one: a file
/// named after the capture (drive.json or drive_0.json for drive.pcap), else the only .json file of which the capture
/// holds packets. To be called for a configuration that nobody has written; one that names an Ouster is left alone.
FoundMetadata find_metadata(const CaptureFolder& folder, Config& config);

/// Has the Ousters of a recording that locusd made read the metadata that was recorded with it.
void use_recorded_metadata(const CaptureFolder& folder, Config& config);

} // namespace locus::tools

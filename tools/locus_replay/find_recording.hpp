// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "drivers/files/capture_folder.hpp"

namespace locus::tools {

/// Recording named by the user, or the only one in the folder named.
struct FoundRecording {
  std::filesystem::path capture;
  CaptureFolder files; ///< a bag, a drive of KITTI or a folder of sweeps has its points in a single path
  std::string line;    ///< for the user, if the recording was not named itself; else empty
};

/// Searches a folder that is not a recording itself two levels deep: KITTI has a day, or sequences, above the drives.
/// Throws Failure if there is no recording or several.
FoundRecording find_recording(const std::filesystem::path& named);

/// Throws Failure for an output folder that is the folder of a recording: the next run would read the results as input.
void check_output(const std::filesystem::path& folder);

} // namespace locus::tools

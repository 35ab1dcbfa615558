// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "drivers/files/capture_folder.hpp"

namespace locus::tools {

/// What the user named, or the only recording in a folder that was named.
struct FoundRecording {
  std::filesystem::path capture;
  CaptureFolder files; ///< a bag, a drive of KITTI or a folder of sweeps has its points in one
  std::string line;    ///< for the user, where it was not named itself; else empty
};

/// Looks two folders deep into one that is no recording itself: KITTI's have a day, or sequences, above the drives.
/// Throws Failure where there is none or are several.
FoundRecording find_recording(const std::filesystem::path& named);

/// Results in the folder of a recording would be taken for its files by the next run: throws Failure.
void check_output(const std::filesystem::path& folder);

} // namespace locus::tools

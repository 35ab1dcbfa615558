// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "config/config.hpp"
#include "core/base/source_id.hpp"
#include "core/sources/motion_sample.hpp"
#include "drivers/files/capture_folder.hpp"
#include "drivers/files/motion_files.hpp"
#include "locus_replay/arguments.hpp"

namespace locus::tools {

/// Samples of one motion source, in order of arrival; in the order recorded if their arrivals go back.
struct MotionRecording {
  SourceId source;
  std::filesystem::path file;
  std::variant<MotionSamples<ImuSample>, MotionSamples<OdometrySample>> samples;
};

/// Reads the motion files that the user named, and those of the folder, for the configured motion sources. Skips a file
/// of the folder without a source with a warning, and so a source without a file, if the configuration is the user's
/// own. Throws Failure for a named file that fits no source or cannot be read.
std::vector<MotionRecording> read_motion(const Arguments& arguments, const CaptureFolder& folder, const Config& config,
                                         bool config_is_users_own, std::vector<std::string>& warnings);

} // namespace locus::tools

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "config/config.hpp"
#include "core/odometry/motion_filter.hpp"
#include "locus_replay/arguments.hpp"
#include "locus_replay/open_recording.hpp"
#include "locus_replay/output_file.hpp"

namespace locus::tools {

/// What a drive tells of the stamps, mountings and scales of its motion sources.
struct CalibratedDrive {
  Config config;          ///< that of the recording, with what is plainly known better taken in
  LearnedSources learned; ///< against that of the recording
};

/// Replays a recording over and over, each time from where the last ended, with samples played as much earlier as they
/// are late: what is small is linear. Throws Failure.
CalibratedDrive calibrate_by_drive(const Arguments& arguments, const ChosenRecording& chosen);

/// What is known better than it is configured, as YAML for the configuration; closes the file. Throws Failure.
void write_calibration(OutputFile& file, const std::vector<MotionSource>& configured, const LearnedSources& learned);

} // namespace locus::tools

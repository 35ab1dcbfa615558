// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>

#include "config/config.hpp"
#include "core/odometry/motion_filter.hpp"
#include "daemon/calibration.hpp"
#include "daemon/odometry_comparison.hpp"
#include "locus_replay/arguments.hpp"
#include "locus_replay/open_recording.hpp"
#include "locus_replay/output_file.hpp"

namespace locus::tools {

/// Estimates from a drive of the lateness, mounting and scale of its motion sources and of the rotation of its lidars.
struct CalibratedDrive {
  Config config;          ///< of the recording, updated by the significant estimates
  Config start;           ///< of the recording, with IMUs whose axes were exchanged or reversed mounted as they are
  LearnedSources learned; ///< relative to `start`, like the other two
  std::array<std::optional<daemon::OdometryFindings>, kMaxSources> compared; ///< by source
  std::optional<daemon::LidarTurn> lidars;
};

/// Replays a recording repeatedly, each time starting from the last result, with samples advanced by their lateness:
/// the remaining errors are small enough to be linear. Throws Failure.
CalibratedDrive calibrate_by_drive(const Arguments& arguments, const ChosenRecording& chosen);

/// Writes what was estimated better than configured, as YAML for the configuration; closes the file. Throws Failure.
void write_calibration(OutputFile& file, const Config& configured, const CalibratedDrive& drive);

} // namespace locus::tools

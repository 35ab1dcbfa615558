// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "drivers/files/capture_folder.hpp"
#include "drivers/net/datagram.hpp"
#include "locus_replay/arguments.hpp"
#include "locus_replay/motion_recordings.hpp"

namespace locus::tools {

/// Input to play, whatever its recorded format.
struct RecordedInput {
  std::unique_ptr<DatagramSource> lidars;
  std::vector<MotionRecording> motion;
  std::string used;               ///< choices made, in one line for the user; empty if there were none
  std::vector<StampedPose> truth; ///< true poses of the base, for a drive or a folder of sweeps
};

/// Opens folder.lidar, a capture, a bag, a drive of KITTI or a folder of sweeps, and all its motion. Files named by the
/// user replace the topics of a bag. `config_is_users_own`: warns about a motion source without samples. Throws
/// Failure.
RecordedInput open_input(const Arguments& arguments, const CaptureFolder& folder, const Config& config,
                         bool config_is_users_own, std::vector<std::string>& warnings);

/// Returns whether it is a folder of sweeps, and not of a kind with precedence.
bool gives_sweeps(const std::filesystem::path& capture);

/// Returns by how much to raise the vertical angles of a drive of KITTI: kKittiVerticalAngle_deg, or zero at the user's
/// request; no value for another kind of recording.
std::optional<double> raised_by_deg(const Arguments& arguments);

} // namespace locus::tools

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

/// What is to be played, whatever the format that it was recorded in.
struct RecordedInput {
  std::unique_ptr<DatagramSource> lidars;
  std::vector<MotionRecording> motion;
  std::string taken;              ///< what was taken for what, in one line for the user; empty where it is plain
  std::vector<StampedPose> truth; ///< of a drive or a folder of sweeps: true poses of the base
};

/// Opens folder.lidar, a capture, a bag, a drive of KITTI or a folder of sweeps, and all motion that belongs to it.
/// Files that the user named take the place of a bag's topics. `config_is_users_own`: then a motion source without
/// samples is worth a warning. Throws Failure.
RecordedInput open_input(const Arguments& arguments, const CaptureFolder& folder, const Config& config,
                         bool config_is_users_own, std::vector<std::string>& warnings);

/// Whether it is a folder of sweeps, and nothing that goes before one.
bool gives_sweeps(const std::filesystem::path& capture);

/// By how much the vertical angles of a drive of KITTI are made larger, kKittiVerticalAngle_deg or, as the user may
/// wish, nothing; no value for what is no such drive.
std::optional<double> raised_by_deg(const Arguments& arguments);

} // namespace locus::tools

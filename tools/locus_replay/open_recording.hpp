// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "config/config_proposal.hpp"
#include "drivers/files/capture_folder.hpp"
#include "drivers/files/motion_files.hpp"
#include "drivers/lidar_router.hpp"
#include "locus_replay/arguments.hpp"
#include "locus_replay/recording.hpp"

namespace locus::tools {

/// Recording and configuration of a replay, before anything is opened.
struct ChosenRecording {
  CaptureFolder files;
  Config config;
  bool config_is_users_own = false;
  ConfigReasons reasons;             ///< of the configuration
  std::vector<std::string> lines;    ///< choices made, for the user
  std::vector<std::string> warnings; ///< a line each
};

/// Finds the recording that arguments.capture names, replaces the name by what was found, and finds its configuration.
/// Throws Failure.
ChosenRecording choose_recording(Arguments& arguments);

/// Recording that is ready to be played.
struct OpenRecording {
  LidarRouter lidars;
  std::unique_ptr<Recording> recording;
  std::vector<StampedPose> truth; ///< contained in the recording itself
};

/// Opens the recording with all its motion, and adds to its lines and warnings. `earlier` as in PlayOptions. Throws
/// Failure.
OpenRecording open_recording(const Arguments& arguments, ChosenRecording& chosen, std::vector<Duration> earlier = {});

} // namespace locus::tools

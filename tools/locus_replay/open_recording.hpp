// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "drivers/files/capture_folder.hpp"
#include "drivers/files/motion_files.hpp"
#include "drivers/lidar_input.hpp"
#include "locus_replay/arguments.hpp"
#include "locus_replay/recording.hpp"

namespace locus::tools {

/// What is to be replayed and with which configuration. Nothing is open yet.
struct ChosenRecording {
  CaptureFolder files;
  Config config;
  bool config_is_users_own = false;
  std::vector<std::string> lines;    ///< what was taken for what, for the user
  std::vector<std::string> warnings; ///< a line each
};

/// Finds the recording that arguments.capture names, which then names what was found, and its configuration. Throws
/// Failure.
ChosenRecording choose_recording(Arguments& arguments);

/// A recording that is ready to be played.
struct OpenRecording {
  LidarRouter lidars;
  std::unique_ptr<Recording> recording;
  std::vector<StampedPose> truth; ///< that the recording itself holds
};

/// Opens it with all motion that belongs to it, and adds to its lines and warnings. `earlier` as PlayOptions has it.
/// Throws Failure.
OpenRecording open_recording(const Arguments& arguments, ChosenRecording& chosen, std::vector<Duration> earlier = {});

} // namespace locus::tools

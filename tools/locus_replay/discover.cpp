// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/discover.hpp"

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "config/config_proposal.hpp"
#include "locus_replay/failure.hpp"

namespace locus::tools {
namespace {

/// Removes the motion sources without samples, and those that belong to a lidar, which have no entry.
void reduce_sources(const Recording& recording, Config& config, ConfigReasons& reasons) {
  for (std::size_t i = config.motion_sources.size(); i-- > 0;) {
    const bool is_of_lidar = config.motion_sources[i].of_lidar;
    const std::filesystem::path* const file = is_of_lidar ? nullptr : recording.file_of(SourceId{i});
    const std::string key = fmt::format("motion_sources.{}.", i);
    std::error_code ignored;
    if (file == nullptr) {
      leave_out_source(i, is_of_lidar ? "" : "nothing of its kind in the recording", config, reasons);
    } else if (std::filesystem::exists(*file, ignored)) { // and is no topic of a bag
      reasons.of_key[key + "name"] = fmt::format("samples in {}", file->string());
      reasons.of_key[key + "topic"] = "of the service; a replay reads the file";
    }
  }
  if (config.motion_sources.empty())
    reasons.of_key["motion_sources"] = "no IMU or odometry in the recording, except that of a lidar itself";
}

/// Adds the mounting of each lidar, and removes the metadata that are found in the bag each time.
void complete_lidars(Config& config, ConfigReasons& reasons) {
  for (std::size_t i = 0; i < config.lidars.size(); ++i) {
    LidarOptions& lidar = config.lidars[i];
    const std::string key = fmt::format("lidars.{}.", i);
    if (lidar.T_base_lidar == Pose{})
      reasons.of_key.try_emplace(key + "T_base_lidar",
                                 "not in the recording: poses are those of the lidar; measure it on the robot");
    if (lidar.metadata_text.empty())
      continue;
    reasons.of_key[key + "name"] = std::exchange(lidar.metadata, "") + " has its metadata";
    reasons.of_key.erase(key + "metadata");
    reasons.of_key.erase(key + "port");
    lidar.ouster = false;
    lidar.port = LidarOptions{}.port;
  }
}

} // namespace

std::string proposal_for(const Arguments& arguments, ChosenRecording& chosen) {
  const bool has_lidar =
      chosen.config_is_users_own ||
      std::ranges::any_of(chosen.reasons.of_key, [](const auto& entry) { return entry.first.starts_with("lidars."); });
  if (!has_lidar)
    throw Failure(ExitStatus::failed,
                  fmt::format("{}: no lidar that can be read is in its first packets; replay it for the reason: "
                              "locus-replay -o out {}",
                              arguments.capture.string(), arguments.capture.string()));
  const OpenRecording open = open_recording(arguments, chosen);
  Config config = chosen.config;
  ConfigReasons reasons = chosen.reasons;
  reduce_sources(*open.recording, config, reasons);
  complete_lidars(config, reasons);
  return fmt::format("# Found in {} by locus-replay --discover. To use it: locus-replay -c FILE -o out {}\n{}",
                     arguments.capture.string(), arguments.capture.string(), print_proposal(config, reasons));
}

} // namespace locus::tools

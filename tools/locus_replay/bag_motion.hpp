// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "bags/bag.hpp"
#include "locus_replay/motion_recordings.hpp"

namespace locus::tools {

/// Reads the samples of the motion sources from a bag; `topic_of_source` by configuration index. Needs 100 MB of memory
/// per hour at 200 Hz. Reads the whole bag and rewinds it.
///
/// The arrival of a sample is its reception by the recorder, by the clock of the lidar's driver: `recorder_ahead` of
/// it.
std::vector<MotionRecording> read_bag_motion(Bag& bag, const std::filesystem::path& file,
                                             const std::vector<std::optional<std::size_t>>& topic_of_source,
                                             Duration recorder_ahead, std::vector<std::string>& warnings);

} // namespace locus::tools

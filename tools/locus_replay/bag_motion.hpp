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

/// What a bag holds of the motion sources, `topic_of_source` by index in the configuration. Held in memory, 100 MB for
/// an hour at 200 Hz. Reads the bag through and leaves it at its first message.
///
/// A sample arrived when the recorder received it. Beside packets, which have the driver's stamps, that is not so where
/// it is more than ten seconds from the sample's own stamp: its clock was another one's, and arrival = stamp.
std::vector<MotionRecording> read_bag_motion(Bag& bag, const std::filesystem::path& file,
                                             const std::vector<std::optional<std::size_t>>& topic_of_source,
                                             bool beside_packets, std::vector<std::string>& warnings);

} // namespace locus::tools

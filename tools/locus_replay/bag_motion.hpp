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
/// The arrival of a sample is its reception by the recorder. Next to packets, which have the driver's stamps, an
/// arrival more than ten seconds from the sample's own stamp indicates another clock; then arrival = stamp.
std::vector<MotionRecording> read_bag_motion(Bag& bag, const std::filesystem::path& file,
                                             const std::vector<std::optional<std::size_t>>& topic_of_source,
                                             bool beside_packets, std::vector<std::string>& warnings);

} // namespace locus::tools

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "bags/bag.hpp"
#include "config/config.hpp"
#include "core/base/source_id.hpp"

namespace locus::tools {

/// Returns whether these are the packets of a lidar, and not of an Ouster's IMU.
bool are_lidar_packets(const BagTopic& topic);
/// Returns whether these are results of locusd: corrected clouds or its odometry, which are no inputs.
bool are_results(const BagTopic& topic, const Config& config);
/// Returns the part of a topic's name before its last word: "/ouster/" for "/ouster/lidar_packets".
std::string_view namespace_of(std::string_view topic);

/// Topics of a bag for the lidars and motion sources of a configuration: indices in Bag::topics().
///
/// A lidar with clouds gets its configured topic. A lidar with packets (PacketType) gets the topic that contains its
/// name, preferably as a whole part between slashes; a motion source gets its configured topic. If one lidar and one
/// topic remain, they are matched, and likewise for motion sources of a kind whose topics are the defaults. An Ouster's
/// IMU packets have a topic beside that of its lidar packets.
struct BagTopics {
  std::vector<std::optional<std::size_t>> of_lidar;  ///< by configuration index
  std::vector<std::optional<std::size_t>> of_imu;    ///< IMU packets of the lidars, by configuration index
  std::vector<std::optional<std::size_t>> of_source; ///< by configuration index
  std::string used;                                  ///< assignments that were guessed, in one line for the user
  std::vector<std::string> doubts; ///< a line for each lidar and motion source that a remaining topic may belong to

  /// Assigns the topics. `has_file`: motion sources that need none. Throws Failure if there is no topic for any lidar.
  static BagTopics choose(const Bag& bag, const std::string& bag_name, const Config& config,
                          const std::function<bool(SourceId)>& has_file);
};

} // namespace locus::tools

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "bags/bag.hpp"
#include "config/config.hpp"
#include "core/base/source_id.hpp"

namespace locus::tools {

/// Which topics of a bag speak for the lidars and the motion sources of a configuration: indices in Bag::topics().
///
/// A lidar of clouds has the topic that the configuration names. A lidar of packets (PacketType) has the one with its
/// name in it, as a part between slashes sooner than within one; a motion source the one that the configuration names.
/// Where one lidar is left without, and one
/// topic, they are taken for each other, and likewise of the motion sources of a kind whose topics are the defaults.
struct BagTopics {
  std::vector<std::optional<std::size_t>> of_lidar;  ///< by index in the configuration
  std::vector<std::optional<std::size_t>> of_source; ///< likewise
  std::string taken;                                 ///< what was taken for what, in one line for the user
  std::vector<std::string> doubts; ///< a line for each lidar and motion source that topics left may be

  /// `has_file`: of a motion source that the bag need not speak for. Throws Failure if there is nothing for any lidar.
  static BagTopics choose(const Bag& bag, const std::string& bag_name, const Config& config,
                          const std::function<bool(SourceId)>& has_file);
};

} // namespace locus::tools

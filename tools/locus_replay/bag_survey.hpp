// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "bags/bag.hpp"
#include "discovery/motion_candidates.hpp"
#include "discovery/static_transforms.hpp"

namespace locus::tools {

/// Sensors in a bag, by its first messages. One owner.
struct BagSurvey {
  struct Topic {
    std::size_t messages = 0;
    std::size_t points = 0;                  ///< of the clouds in these messages
    std::string frame;                       ///< of the first message; empty if unknown
    std::optional<MotionCandidate> motion{}; ///< of an IMU or an odometry
  };
  std::unique_ptr<Bag> bag;            ///< read in part
  std::map<std::size_t, Topic> topics; ///< of sensors whose messages have a header, by index in Bag::topics()
  StaticTransforms transforms;

  /// Reads ten seconds of the bag, or less once it has three clouds of each topic, a hundred samples of each IMU, a
  /// message of each other sensor, and the transforms. Of several odometries it reads until each has moved, if need be
  /// the whole bag. Throws Failure for a bag that cannot be opened.
  static BagSurvey of(const std::filesystem::path& file);
};

} // namespace locus::tools

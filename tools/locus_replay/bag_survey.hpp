// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include "bags/bag.hpp"
#include "bags/static_transforms.hpp"

namespace locus::tools {

/// Sensors in a bag, by its first messages. One owner.
struct BagSurvey {
  struct Topic {
    std::size_t messages = 0;
    std::size_t points = 0; ///< of the clouds in these messages
    std::string frame;      ///< of the first message; empty if unknown
  };
  std::unique_ptr<Bag> bag;            ///< read in part
  std::map<std::size_t, Topic> topics; ///< of clouds, packets with a header and IMUs, by index in Bag::topics()
  StaticTransforms transforms;

  /// Reads ten seconds of the bag, or less once it has three clouds of each topic, a message of each other sensor, and
  /// the transforms. Throws Failure for a bag that cannot be opened.
  static BagSurvey of(const std::filesystem::path& file);
};

} // namespace locus::tools

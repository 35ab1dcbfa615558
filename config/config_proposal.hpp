// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "config/config.hpp"

namespace locus {

/// Reasons for a configuration that was derived from a recording or from the traffic on a network.
struct ConfigReasons {
  /// Lidar or motion source that was found as well, and why it is not used.
  template <class Item> struct Candidate {
    Item item;
    std::string reason;
  };

  std::map<std::string, std::string> of_key; ///< by path of the key, such as "lidars.0.topic"
  std::string of_other_keys;                 ///< of those that differ from their defaults without a reason of their own
  std::vector<Candidate<LidarOptions>> other_lidars;
  std::vector<Candidate<MotionSource>> other_sources;
};

/// Removes a motion source, and its reasons, from a proposal; lists it as a candidate that is not used unless `why` is
/// empty.
void leave_out_source(std::size_t index, const std::string& why, Config& config, ConfigReasons& reasons);

/// Formats the lidars, the motion sources and all keys that differ from their defaults as YAML, a key and its reason on
/// each line; the other candidates are comments. load_config() reads the text back to the same configuration.
std::string print_proposal(const Config& config, const ConfigReasons& reasons);

} // namespace locus

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "config/config.hpp"
#include "core/base/expected.hpp"

namespace locus::daemon {

/// Comparison of a configuration with the traffic on the network; each entry is one line for the user.
struct LiveCheck {
  std::vector<std::string> matches;
  std::vector<std::string> differences; ///< difference and remedy
};

/// Listens to all lidar packets and to the configured topics for `duration`. Does not disturb a running service. Fails
/// with one line for the user if listening is not permitted.
Expected<LiveCheck, std::string> check_live(const Config& config, Duration duration);

} // namespace locus::daemon

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "config/config.hpp"
#include "core/base/expected.hpp"

namespace locus::daemon {

/// What a configuration says beside what is on the wire: one line for the user each.
struct LiveCheck {
  std::vector<std::string> agrees;
  std::vector<std::string> differs; ///< what differs, and what to do
};

/// Listens for a while to whatever lidars send and to the topics of the motion sources. A service that runs is not
/// disturbed. Fails with one line for the user where it may not listen.
Expected<LiveCheck, std::string> check_live(const Config& config, Duration duration);

} // namespace locus::daemon

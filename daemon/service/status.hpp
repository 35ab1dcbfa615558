// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <nlohmann/json.hpp>

#include "daemon/dds/ros_messages.hpp"
#include "daemon/service/session.hpp"

namespace locus::daemon {

/// All that can be told of a running service: the keys of locus-replay's summary.json that make sense here, and what
/// only a live service has.
nlohmann::ordered_json status_json(Session& session);

/// The same for /diagnostics: one line for the odometry, DDS, each lidar and each motion source, every counter in it.
std::vector<Diagnostic> diagnostics(Session& session);

/// In one line of plain words, for systemctl status.
std::string status_line(Session& session);

} // namespace locus::daemon

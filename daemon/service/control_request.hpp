// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "core/base/expected.hpp"
#include "core/base/options.hpp"
#include "core/base/pose.hpp"

namespace locus::daemon {

/// What locusctl may ask for.
struct ShowStatus {};
struct SaveMap {};
struct SetFlatGround {
  FlatGround mode;
};
struct Reset {
  std::optional<Pose> T_odom_base; ///< where the odometry begins anew; nothing: at the origin
};
struct Reload {};
using ControlRequest = std::variant<ShowStatus, SaveMap, SetFlatGround, Reset, Reload>;

/// Of the bytes of one message, which may be anything: {"command": "status" | "save-map" | "reload"}, {"command":
/// "flat-ground", "mode": "on" | "off" | "auto"}, {"command": "reset"} with "pose": [x, y, z, roll, pitch, yaw] in
/// metres and degrees if need be. Fails with one line for the user. Any thread.
Expected<ControlRequest, std::string> parse_control_request(std::string_view message);

} // namespace locus::daemon

// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/control_request.hpp"

#include <array>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace locus::daemon {

namespace {

using Parsed = Expected<ControlRequest, std::string>;

Parsed parse_flat_ground(const nlohmann::json& request) {
  const std::string mode = request.at("mode");
  if (mode == "on")
    return ControlRequest{SetFlatGround{FlatGround::on}};
  if (mode == "off")
    return ControlRequest{SetFlatGround{FlatGround::off}};
  if (mode == "auto")
    return ControlRequest{SetFlatGround{FlatGround::automatic}};
  return std::string{"flat-ground must be on, off or auto"};
}

Parsed parse_reset(const nlohmann::json& request) {
  constexpr double kFarthest_m = 500e3, kMost_deg = 360.0; // a map reaches as far, see SurfaceGrid::reaches()
  if (!request.contains("pose"))
    return ControlRequest{Reset{}};
  const auto v = request["pose"].get<std::array<double, 6>>();
  for (std::size_t i = 0; i < v.size(); ++i)
    if (!(std::abs(v[i]) <= (i < 3 ? kFarthest_m : kMost_deg)))
      return fmt::format("the pose must lie within {:.0f} m and {:.0f} degrees; give X,Y,Z,R,P,Y", kFarthest_m,
                         kMost_deg);
  return ControlRequest{Reset{Pose{from_rpy_rad(Eigen::Vector3d{v[3], v[4], v[5]} * kRadPerDeg), {v[0], v[1], v[2]}}}};
}

} // namespace

Expected<ControlRequest, std::string> parse_control_request(std::string_view message) {
  try {
    const auto request = nlohmann::json::parse(message);
    const std::string command = request.at("command");
    if (command == "status")
      return ControlRequest{ShowStatus{}};
    if (command == "save-map")
      return ControlRequest{SaveMap{}};
    if (command == "flat-ground")
      return parse_flat_ground(request);
    if (command == "reset")
      return parse_reset(request);
    if (command == "reload")
      return ControlRequest{Reload{}};
    return fmt::format("unknown command {}; use locusctl of the same version", command);
  } catch (const nlohmann::json::exception&) {
    return std::string{"no request, or it lacks something; use locusctl of the same version"};
  }
}

} // namespace locus::daemon

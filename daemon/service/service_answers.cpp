// SPDX-License-Identifier: Apache-2.0
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include <fmt/format.h>

#include "daemon/machine_time.hpp"
#include "daemon/service/service.hpp"

namespace locus::daemon {

std::optional<ControlServer::Answer> Service::answer(const ControlRequest& request) {
  if (!session_) // ended by a failed reload of another client
    return ControlServer::Answer::refusal("the service is stopping; see: journalctl -u locusd");
  return std::visit([this](const auto& one) { return answer(one); }, request);
}

std::optional<ControlServer::Answer> Service::answer(ShowStatus request) {
  const Figures figures = session_->figures();
  if (request.as_text)
    return ControlServer::Answer{{{"text", to_text(figures)}}, {}};
  return ControlServer::Answer{to_json(figures), {}};
}

std::optional<ControlServer::Answer> Service::answer(SetFlatGround request) {
  session_->set_flat_ground(request.mode);
  return ControlServer::Answer::done();
}

std::optional<ControlServer::Answer> Service::answer(const Reset& request) {
  if (const auto problem = session_->reset(request.T_odom_base))
    return ControlServer::Answer::refusal(*problem);
  return ControlServer::Answer::done();
}

std::optional<ControlServer::Answer> Service::answer(Reload /*request*/) { return reload(); }

std::optional<ControlServer::Answer> Service::answer(StoreIncident request) {
  using Answer = ControlServer::Answer;
  const Figures figures = session_->figures();
  if (!figures.live->incidents)
    return Answer::refusal(
        "incidents are not stored; set record.keep_s, and without systemd STATE_DIRECTORY and a tmpfs as "
        "RUNTIME_DIRECTORY, or record.folder");
  if (request.keep_s > figures.config.record.keep_s)
    return Answer::wrong_usage(
        fmt::format("at most {:g}s can be stored; see record.keep_s", figures.config.record.keep_s));
  const Stamp now{read_clock(CLOCK_REALTIME)};
  const auto folder = incidents_->submit(
      {IncidentCause::asked, from_seconds(request.keep_s), now, incident_report(IncidentCause::asked, now, figures)});
  if (!folder)
    return Answer::refusal(folder.error());
  return Answer{{{"folder", folder->string()}}, {}};
}

/// Returns the points of the map in their memory layout; empty until the odometry thread has delivered them. A request
/// whose client has timed out is repeated, since its map would be stale.
std::optional<ControlServer::Answer> Service::answer(SaveMap /*request*/) {
  const Duration now = read_clock(CLOCK_MONOTONIC);
  if (!map_requested_at_ || now - *map_requested_at_ > ControlServer::kAnswerTimeout) {
    session_->request_map();
    map_requested_at_ = now;
  }
  const std::vector<SurfacePoint>* const points = session_->poll_map();
  if (points == nullptr)
    return std::nullopt;
  map_requested_at_.reset();
  const auto bytes = std::as_bytes(std::span(*points));
  return ControlServer::Answer{{{"points", points->size()}}, {bytes.begin(), bytes.end()}};
}

/// Returns the status and the newest sweep with its points in their memory layout.
std::optional<ControlServer::Answer> Service::answer(ShowSweep /*request*/) {
  ControlServer::Answer answer{{{"status", to_json(session_->figures())}}, {}};
  const Session::ViewedSweep* const sweep = session_->view();
  if (sweep == nullptr)
    return answer;
  const Pose& T = sweep->T_odom_base;
  answer.json["sweep"] = {{"run", to_ns(sweep->run_began)},
                          {"sequence", sweep->sequence},
                          {"t_ns", to_ns(sweep->stamp)},
                          {"xyz_m", {T.translation.x(), T.translation.y(), T.translation.z()}},
                          {"quaternion_xyzw", {T.rotation.x(), T.rotation.y(), T.rotation.z(), T.rotation.w()}}};
  const auto bytes = std::as_bytes(std::span(sweep->points));
  answer.bytes.assign(bytes.begin(), bytes.end());
  return answer;
}

} // namespace locus::daemon

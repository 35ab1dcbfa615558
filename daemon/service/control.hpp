// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include <nlohmann/json.hpp>
#include <poll.h>

#include "core/base/expected.hpp"
#include "core/base/options.hpp"
#include "core/base/pose.hpp"
#include "daemon/descriptor.hpp"

namespace locus::daemon {

/// Requests of locusctl.
struct ShowStatus {
  bool as_text = false; ///< formatted text; otherwise JSON
};
struct SaveMap {};
struct ShowSweep {}; ///< status and newest sweep, for a viewer
struct SetFlatGround {
  FlatGround mode;
};
struct Reset {
  std::optional<Pose> T_odom_base; ///< initial pose after the reset; empty: the origin
};
struct Reload {};
struct StoreIncident {
  double keep_s; ///< length of the input to store, up to now
};
using ControlRequest = std::variant<ShowStatus, SaveMap, ShowSweep, SetFlatGround, Reset, Reload, StoreIncident>;

/// Parses one message of arbitrary bytes: {"command": "save-map" | "view" | "reload"}, {"command": "status"} with
/// "text": true for an answer {"text": "..."}, {"command": "flat-ground", "mode": "on" | "off" | "auto"}, {"command":
/// "record", "keep_s": 60} for an answer {"folder": "..."}, whose progress the status reports, {"command": "reset"}
/// with an optional "pose": [x, y, z, roll, pitch, yaw] in metres and degrees. Fails with one line for the user. Any
/// thread.
Expected<ControlRequest, std::string> parse_control_request(std::string_view message);

/// Server for locusctl: a Unix socket on which each message is one JSON request or answer.
///
/// An answer contains "error" if the request was refused, and "wrong_usage" if the request was invalid; it may carry
/// bytes in a memory file, so that a slow reader does not block the service. Any local user may request the status; the
/// other commands require root, the service's own user or group locusd, whose connections take precedence over those of
/// other users. One owner, the main thread.
class ControlServer {
 public:
  struct Answer {
    nlohmann::ordered_json json;
    std::vector<std::byte> bytes;

    static Answer done() { return {{{"done", true}}, {}}; }
    static Answer refusal(const std::string& why) { return {{{"error", why}}, {}}; }
    static Answer wrong_usage(const std::string& why) { return {{{"error", why}, {"wrong_usage", true}}, {}}; }
  };
  /// Callback that answers a request; empty while there is no answer yet: serve() then repeats the request for up to
  /// kAnswerTimeout.
  using Handler = std::function<std::optional<Answer>(const ControlRequest& request)>;

  static constexpr std::size_t kMaxClients = 16;
  static constexpr Duration kAnswerTimeout = std::chrono::seconds{3};

  /// Opens the socket, whose owner also owns its folder. Fails with one line for the user, also if another service
  /// listens on it.
  static Expected<ControlServer, std::string> open(const std::filesystem::path& path, Handler handler);

  void add_to(std::vector<pollfd>& poll) const;
  /// Serves one request of each client, without waiting. True if a client connected, disconnected or was answered.
  bool serve();

 private:
  struct Client {
    Descriptor socket;
    std::optional<Expected<ControlRequest, std::string>> pending;
    Duration requested_at{};
  };

  ControlServer(Descriptor listener, Handler handler) : listener_(std::move(listener)), handler_(std::move(handler)) {}
  /// Accepts waiting clients; true if there was one.
  bool accept_waiting();
  void drop_unprivileged_client();
  /// Serves a client; false if it is to be disconnected.
  bool serve(Client& client);
  [[nodiscard]] std::optional<Answer> handle(Client& client);

  Descriptor listener_;
  Handler handler_;
  std::vector<Client> clients_;
  std::uint64_t answered_ = 0;
};

/// Returns $RUNTIME_DIRECTORY/control, with the variable set by systemd; by default /run/locusd/control.
std::filesystem::path control_path();
/// Returns NAME of the service locusd@NAME, from the same variable; empty outside an instance.
std::string instance_name();

} // namespace locus::daemon

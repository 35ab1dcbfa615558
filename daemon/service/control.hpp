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

/// What locusctl may ask for.
struct ShowStatus {
  bool as_text = false; ///< for human eyes; else as JSON
};
struct SaveMap {};
struct SetFlatGround {
  FlatGround mode;
};
struct Reset {
  std::optional<Pose> T_odom_base; ///< where the odometry begins anew; nothing: at the origin
};
struct Reload {};
struct KeepIncident {
  double keep_s; ///< of what came last
};
using ControlRequest = std::variant<ShowStatus, SaveMap, SetFlatGround, Reset, Reload, KeepIncident>;

/// Of the bytes of one message, which may be anything: {"command": "save-map" | "reload"}, {"command": "status"} with
/// "text": true for an answer {"text": "..."}, {"command": "flat-ground", "mode": "on" | "off" | "auto"}, {"command":
/// "record", "keep_s": 60} for an answer {"folder": "..."} where the status tells what becomes of it, {"command":
/// "reset"} with "pose": [x, y, z, roll, pitch, yaw] in metres and degrees if need be. Fails with one line for the
/// user. Any thread.
Expected<ControlRequest, std::string> parse_control_request(std::string_view message);

/// Where locusctl reaches the service: a Unix socket on which each message is one request or one answer, in JSON.
///
/// An answer holds "error" if it was refused, and "wrong_usage" if what was asked for was wrong; it may bring bytes
/// along in a memory file, so that nobody waits for a slow reader. Everybody on the machine may ask for the status; the
/// other commands are for root, the service's own user and members of group locusd, who find room however many others
/// are there. One owner, the main thread.
class ControlServer {
 public:
  struct Answer {
    nlohmann::ordered_json json;
    std::vector<std::byte> bytes;

    static Answer done() { return {{{"done", true}}, {}}; }
    static Answer refusal(const std::string& why) { return {{{"error", why}}, {}}; }
    static Answer wrong_usage(const std::string& why) { return {{{"error", why}, {"wrong_usage", true}}, {}}; }
  };
  /// Nothing: the answer is not there yet; the same request is made again at the next serve(), for a few seconds.
  using Handler = std::function<std::optional<Answer>(const ControlRequest& request)>;

  static constexpr std::size_t kMaxClients = 16;
  static constexpr Duration kLongestAnswer = std::chrono::seconds{3};

  /// Fails with one line for the user, also where another service answers: who has the socket owns its folder.
  static Expected<ControlServer, std::string> open(const std::filesystem::path& path, Handler handler);

  void add_to(std::vector<pollfd>& poll) const;
  /// Takes what has come, without waiting, one request of each client. Whether anybody called, hung up or was
  /// answered.
  bool serve();

 private:
  struct Client {
    Descriptor socket;
    std::optional<Expected<ControlRequest, std::string>> pending;
    Duration asked{};
  };

  ControlServer(Descriptor listener, Handler handler) : listener_(std::move(listener)), handler_(std::move(handler)) {}
  /// Whether there was one.
  bool accept_waiting();
  void drop_a_stranger();
  /// Whether the client stays.
  bool serve(Client& client);
  [[nodiscard]] std::optional<Answer> handle(Client& client);

  Descriptor listener_;
  Handler handler_;
  std::vector<Client> clients_;
  std::uint64_t answered_ = 0;
};

/// $RUNTIME_DIRECTORY/control as systemd sets it, else /run/locusd/control.
std::filesystem::path control_path();
/// NAME of the service locusd@NAME, by the same variable; empty if it is no instance.
std::string instance_name();

} // namespace locus::daemon

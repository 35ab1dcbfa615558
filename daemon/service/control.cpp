// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/control.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <system_error>

#include <fmt/format.h>
#include <grp.h>
#include <nlohmann/json.hpp>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "daemon/machine_time.hpp"
#include "daemon/unix_socket.hpp"

namespace locus::daemon {

namespace {

using Parsed = Expected<ControlRequest, std::string>;

Parsed parse_flat_ground(const nlohmann::json& request) {
  if (const auto mode = from_string<FlatGround>(request.at("mode").get<std::string>()))
    return ControlRequest{SetFlatGround{*mode}};
  return std::string{"flat-ground must be on, off or auto"};
}

Parsed parse_reset(const nlohmann::json& request) {
  constexpr double kMaxDistance_m = 500e3, kMaxAngle_deg = 360.0; // extent of a map, see SurfaceGrid::reaches()
  if (!request.contains("pose"))
    return ControlRequest{Reset{}};
  const auto v = request["pose"].get<std::array<double, 6>>();
  for (std::size_t i = 0; i < v.size(); ++i)
    if (!(std::abs(v[i]) <= (i < 3 ? kMaxDistance_m : kMaxAngle_deg)))
      return fmt::format("the pose must lie within {:.0f} m and {:.0f} degrees; write it as X,Y,Z,R,P,Y",
                         kMaxDistance_m, kMaxAngle_deg);
  return ControlRequest{Reset{Pose{from_rpy_rad(Eigen::Vector3d{v[3], v[4], v[5]} * kRadPerDeg), {v[0], v[1], v[2]}}}};
}

Parsed parse_record(const nlohmann::json& request) {
  const double keep_s = request.at("keep_s").get<double>();
  if (!(keep_s >= 1.0 && keep_s <= 600.0))
    return std::string{"the length to keep must be 1s to 600s"};
  return ControlRequest{StoreIncident{keep_s}};
}

} // namespace

Expected<ControlRequest, std::string> parse_control_request(std::string_view message) {
  try {
    const auto request = nlohmann::json::parse(message);
    const std::string command = request.at("command");
    if (command == "status")
      return ControlRequest{ShowStatus{request.value("text", false)}};
    if (command == "save-map")
      return ControlRequest{SaveMap{}};
    if (command == "view")
      return ControlRequest{ShowSweep{}};
    if (command == "flat-ground")
      return parse_flat_ground(request);
    if (command == "reset")
      return parse_reset(request);
    if (command == "record")
      return parse_record(request);
    if (command == "reload")
      return ControlRequest{Reload{}};
    return fmt::format("unknown command {}; use locusctl of the same version", command);
  } catch (const nlohmann::json::exception&) {
    return std::string{"invalid or incomplete request; use locusctl of the same version"};
  }
}

namespace {

constexpr std::size_t kMaxRequestBytes = 4096;

std::vector<gid_t> groups_of(int client) {
  std::vector<gid_t> groups(256);
  auto size = static_cast<socklen_t>(groups.size() * sizeof(gid_t));
  if (getsockopt(client, SOL_SOCKET, SO_PEERGROUPS, groups.data(), &size) != 0)
    size = 0;
  groups.resize(size / sizeof(gid_t));
  return groups;
}

/// Returns the group of privileged users. Looked up once a second at most, since other users may send requests at any
/// rate. Main thread only.
std::optional<gid_t> privileged_group() {
  static std::optional<gid_t> privileged_group;
  static Duration refreshed_at = -std::chrono::hours{1};
  if (const Duration now = read_clock(CLOCK_MONOTONIC); now - refreshed_at > std::chrono::seconds{1}) {
    const group* const found = getgrnam("locusd"); // NOLINT(concurrency-mt-unsafe)
    privileged_group = found != nullptr ? std::optional{found->gr_gid} : std::nullopt;
    refreshed_at = now;
  }
  return privileged_group;
}

bool is_privileged(int client) {
  ucred peer{};
  socklen_t size = sizeof(peer);
  if (getsockopt(client, SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0)
    return false;
  if (peer.uid == 0 || peer.uid == geteuid())
    return true;
  const std::optional<gid_t> allowed = privileged_group();
  if (!allowed)
    return false;
  const std::vector<gid_t> groups = groups_of(client);
  return peer.gid == *allowed || std::ranges::find(groups, *allowed) != groups.end();
}

Descriptor memory_file(std::span<const std::byte> bytes) {
  Descriptor file{memfd_create("answer", MFD_CLOEXEC)};
  while (!bytes.empty()) {
    const ssize_t written = write(file.number(), bytes.data(), bytes.size());
    if (written <= 0)
      return Descriptor{};
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
  return file;
}

/// Sends an answer without blocking; false if the client's buffer has no room for it.
bool send(int client, const ControlServer::Answer& answer) {
  std::string text = answer.json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
  const Descriptor file = answer.bytes.empty() ? Descriptor{} : memory_file(answer.bytes);
  iovec vector{text.data(), text.size()};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> control{};
  msghdr message{};
  message.msg_iov = &vector;
  message.msg_iovlen = 1;
  if (file.number() >= 0) {
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    cmsghdr* const header = CMSG_FIRSTHDR(&message);
    header->cmsg_level = SOL_SOCKET;
    header->cmsg_type = SCM_RIGHTS;
    header->cmsg_len = CMSG_LEN(sizeof(int));
    const int number = file.number();
    std::memcpy(CMSG_DATA(header), &number, sizeof(number));
  }
  return sendmsg(client, &message, MSG_DONTWAIT | MSG_NOSIGNAL) >= 0;
}

std::filesystem::path runtime_folder() {
  const char* const folder = std::getenv("RUNTIME_DIRECTORY"); // NOLINT(concurrency-mt-unsafe): never set here
  return folder != nullptr ? folder : "/run/locusd";
}

} // namespace

std::filesystem::path control_path() { return runtime_folder() / "control"; }

std::string instance_name() {
  const std::string unit = runtime_folder().filename();
  return unit.starts_with("locusd@") ? unit.substr(std::strlen("locusd@")) : "";
}

Expected<ControlServer, std::string> ControlServer::open(const std::filesystem::path& path, Handler handler) {
  const auto failed = [&](const char* what) {
    return fmt::format("{}: {}; locusctl will not reach this service, and no incidents are stored: {}", path.string(),
                       std::generic_category().message(errno), what);
  };
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.native().size() >= sizeof(address.sun_path)) {
    errno = ENAMETOOLONG;
    return failed("set RUNTIME_DIRECTORY to a shorter path");
  }
  path.native().copy(address.sun_path, sizeof(address.sun_path) - 1);
  std::error_code ignored;
  std::filesystem::create_directories(path.parent_path(), ignored);
  remove_if_left_behind(path, SOCK_SEQPACKET);
  Descriptor listener{::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)};
  if (bind(listener.number(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0)
    return failed(errno == EADDRINUSE
                      ? "another service uses it, or it is not a socket; set RUNTIME_DIRECTORY to a folder of its own"
                      : "set RUNTIME_DIRECTORY to a writable folder");
  constexpr mode_t kReadWriteForAll = 0666; // requests are checked by the peer's credentials
  if (chmod(path.c_str(), kReadWriteForAll) != 0 || listen(listener.number(), kMaxClients) != 0)
    return failed("cannot listen on it");
  return ControlServer{std::move(listener), std::move(handler)};
}

void ControlServer::add_to(std::vector<pollfd>& poll) const {
  poll.push_back({listener_.number(), POLLIN, 0});
  for (const Client& client : clients_)
    poll.push_back({client.socket.number(), POLLIN, 0});
}

bool ControlServer::serve() {
  const std::uint64_t answered_before = answered_;
  const bool has_accepted = accept_waiting();
  const std::size_t disconnected = std::erase_if(clients_, [this](Client& client) { return !serve(client); });
  return has_accepted || disconnected > 0 || answered_ != answered_before;
}

/// Accepts at most kMaxClients per call, so that repeated connects do not block the service.
bool ControlServer::accept_waiting() {
  for (std::size_t i = 0; i < kMaxClients; ++i) {
    Descriptor client{accept4(listener_.number(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC)};
    if (client.number() < 0)
      return i > 0 || accept_has_failed();
    if (clients_.size() == kMaxClients && is_privileged(client.number()))
      drop_unprivileged_client();
    if (clients_.size() < kMaxClients)
      clients_.push_back({std::move(client), std::nullopt, {}});
    else
      send(client.number(), Answer::refusal("too many clients; end another locusctl"));
  }
  return true;
}

/// Disconnects an unprivileged client to make room for a privileged one.
void ControlServer::drop_unprivileged_client() {
  const auto unprivileged =
      std::ranges::find_if(clients_, [](const Client& client) { return !is_privileged(client.socket.number()); });
  if (unprivileged != clients_.end())
    clients_.erase(unprivileged);
}

bool ControlServer::serve(Client& client) {
  if (!client.pending) {
    std::array<char, kMaxRequestBytes> text{};
    const ssize_t size = recv(client.socket.number(), text.data(), text.size(), MSG_DONTWAIT);
    if (size < 0)
      return errno == EAGAIN || errno == EINTR;
    if (size == 0)
      return false;
    client.pending = parse_control_request({text.data(), static_cast<std::size_t>(size)});
    client.requested_at = read_clock(CLOCK_MONOTONIC);
  }
  const std::optional<Answer> answer = handle(client);
  if (!answer)
    return true;
  client.pending.reset();
  ++answered_;
  return send(client.socket.number(), *answer);
}

std::optional<ControlServer::Answer> ControlServer::handle(Client& client) {
  const Expected<ControlRequest, std::string>& request = *client.pending;
  if (!request)
    return Answer::wrong_usage(request.error());
  if (!std::holds_alternative<ShowStatus>(*request) && !is_privileged(client.socket.number()))
    return Answer::refusal("not permitted; be root or a member of group locusd");
  if (read_clock(CLOCK_MONOTONIC) - client.requested_at > kAnswerTimeout)
    return Answer::refusal("no answer in time; is there lidar data (locusctl status)?");
  return handler_(*request);
}

} // namespace locus::daemon

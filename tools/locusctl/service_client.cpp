// SPDX-License-Identifier: Apache-2.0
#include "locusctl/service_client.hpp"

#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <string>

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "locus_replay/failure.hpp"

namespace locus::tools {
namespace {

constexpr std::size_t kMaxAnswerBytes = 1 << 18;

/// Suggests a remedy; derives the unit's name from the folder, if systemd created it.
std::string remedy(const std::filesystem::path& socket, int error) {
  const std::filesystem::path folder = socket.parent_path();
  const std::string unit = folder.filename().string();
  if (error == EACCES)
    return fmt::format("this account may not access {}; ask its owner, or be root", folder.string());
  if (folder.parent_path() != "/run" || !unit.starts_with("locusd"))
    return fmt::format("is there a locusd whose RUNTIME_DIRECTORY is {}?", folder.string());
  return fmt::format("start it with: systemctl start {0}; if it stops again: journalctl -u {0}", unit);
}

std::vector<std::byte> read_all(int descriptor) {
  const off_t size = lseek(descriptor, 0, SEEK_END);
  std::vector<std::byte> bytes(static_cast<std::size_t>(std::max<off_t>(size, 0)));
  std::size_t done = 0;
  for (ssize_t count = 1; count > 0 && done < bytes.size();
       done += static_cast<std::size_t>(std::max<ssize_t>(count, 0)))
    count = pread(descriptor, bytes.data() + done, bytes.size() - done, static_cast<off_t>(done));
  close(descriptor);
  if (done != bytes.size())
    throw Failure(ExitStatus::failed, "the service's answer is incomplete; try again");
  return bytes;
}

} // namespace

ServiceConnection::ServiceConnection(const std::filesystem::path& socket)
    : socket_(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0)) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  socket.native().copy(address.sun_path, sizeof(address.sun_path) - 1);
  if (connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0)
    return;
  const int error = errno;
  close(socket_);
  throw Failure(ExitStatus::failed,
                fmt::format("{}: no service answers ({}); {}", socket.string(), std::strerror(error), // NOLINT
                            remedy(socket, error)));
}

ServiceConnection::~ServiceConnection() { close(socket_); }

ServiceAnswer ServiceConnection::request(const nlohmann::ordered_json& request) const {
  const std::string command = request.value("command", "");
  const bool answers_at_once = command == "status" || command == "view";
  const timeval timeout{answers_at_once ? 5 : 30, 0};
  setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof(timeout));
  const std::string message = request.dump();
  ::send(socket_, message.data(), message.size(), MSG_NOSIGNAL);
  const auto [text, descriptor] = receive();
  ServiceAnswer answer{nlohmann::ordered_json::parse(text, nullptr, false), {}};
  if (descriptor >= 0)
    answer.bytes = read_all(descriptor);
  if (!answer.json.is_object())
    throw Failure(ExitStatus::failed, "the service's answer is invalid; use locusctl of the same version");
  if (answer.json.contains("error"))
    throw Failure(answer.json.contains("wrong_usage") ? ExitStatus::wrong_usage : ExitStatus::failed,
                  answer.json["error"].get<std::string>());
  return answer;
}

std::pair<std::string, int> ServiceConnection::receive() const {
  std::string text(kMaxAnswerBytes, '\0');
  iovec vector{text.data(), text.size()};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> control{};
  msghdr message{};
  message.msg_iov = &vector;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  const ssize_t size = recvmsg(socket_, &message, MSG_CMSG_CLOEXEC);
  if (size <= 0)
    throw Failure(ExitStatus::failed, "the service does not answer; see: systemctl status locusd");
  text.resize(static_cast<std::size_t>(size));
  int descriptor = -1;
  if (const cmsghdr* header = CMSG_FIRSTHDR(&message); header != nullptr && header->cmsg_type == SCM_RIGHTS)
    std::memcpy(&descriptor, CMSG_DATA(header), sizeof(descriptor));
  return {text, descriptor};
}

ServiceAnswer send_request(const std::filesystem::path& socket, const nlohmann::ordered_json& request) {
  return ServiceConnection(socket).request(request);
}

} // namespace locus::tools

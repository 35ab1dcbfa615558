// SPDX-License-Identifier: Apache-2.0
#include "daemon/unix_socket.hpp"

#include <cerrno>
#include <system_error>

#include <sys/socket.h>
#include <sys/un.h>

#include "daemon/descriptor.hpp"

namespace locus::daemon {

void remove_if_left_behind(const std::filesystem::path& socket, int type) {
  std::error_code ignored;
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (socket.native().size() >= sizeof(address.sun_path) || !std::filesystem::is_socket(socket, ignored))
    return;
  socket.native().copy(address.sun_path, sizeof(address.sun_path) - 1);
  const Descriptor client{::socket(AF_UNIX, type | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)};
  if (connect(client.number(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0 &&
      errno == ECONNREFUSED)
    std::filesystem::remove(socket, ignored);
}

bool accept_has_failed() { return errno != EAGAIN && errno != EINTR; }

} // namespace locus::daemon

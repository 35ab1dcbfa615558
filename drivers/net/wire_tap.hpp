// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "core/base/expected.hpp"
#include "drivers/files/udp_frame.hpp"
#include "drivers/net/datagram.hpp"
#include "drivers/net/udp_socket.hpp"

namespace locus {

/// Overhears the UDP datagrams that reach this computer, whoever they are for. One owner.
class WireTap {
 public:
  using Take = std::function<void(const Datagram&)>;

  /// Reads the frames of all interfaces where that is permitted (CAP_NET_RAW), so a service that listens is not
  /// disturbed; elsewhere it listens to those of `ports` that are free. Fails with one line for the user.
  static Expected<WireTap, std::string> open(std::span<const std::uint16_t> ports);

  ~WireTap();
  WireTap(WireTap&& other) noexcept;
  WireTap& operator=(WireTap&&) = delete;

  /// Whether what is for other ports is heard, too.
  [[nodiscard]] bool hears_all() const { return frames_ >= 0; }

  /// Hands out what comes in this time, stamped by the clock of this computer; a datagram is valid during the call.
  void listen(Duration duration, const Take& take);

 private:
  WireTap(int frames, std::vector<UdpSocket> sockets) : frames_(frames), sockets_(std::move(sockets)) {}
  void wait(Duration timeout) const;
  void take_frames(const Take& take);

  int frames_; ///< packet socket; -1 where it is not permitted
  std::vector<UdpSocket> sockets_;
  IpFragments fragments_;
  std::array<std::byte, 65536> frame_{};
};

} // namespace locus

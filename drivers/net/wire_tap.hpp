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

/// Captures the UDP datagrams that reach this computer, whatever their destination. Single owner, not thread-safe.
class WireTap {
 public:
  using Receiver = std::function<void(const Datagram&)>;

  /// Captures frames on all interfaces if permitted (CAP_NET_RAW), without disturbing a service that uses the ports;
  /// otherwise binds those of `ports` that are free. Fails with one line for the user.
  static Expected<WireTap, std::string> open(std::span<const std::uint16_t> ports);

  ~WireTap();
  WireTap(WireTap&& other) noexcept;
  WireTap& operator=(WireTap&&) = delete;

  /// Returns true if datagrams to all ports are captured.
  [[nodiscard]] bool captures_all() const { return frames_ >= 0; }

  /// Passes received datagrams to `receive` for `duration`, stamped by this computer's clock; a datagram is valid
  /// during the call.
  void listen(Duration duration, const Receiver& receive);

 private:
  WireTap(int frames, std::vector<UdpSocket> sockets) : frames_(frames), sockets_(std::move(sockets)) {}
  void wait(Duration timeout) const;
  void read_frames(const Receiver& receive);

  int frames_; ///< packet socket; -1 if not permitted
  std::vector<UdpSocket> sockets_;
  IpFragments fragments_;
  std::array<std::byte, 65536> frame_{};
};

} // namespace locus

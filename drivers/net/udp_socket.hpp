// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <linux/filter.h>

#include "core/base/expected.hpp"
#include "drivers/net/datagram.hpp"

namespace locus {

/// A UDP port that lidars send to, whether to this host, by broadcast or by multicast.
///
/// The kernel stamps each datagram when it comes, and counts those that it had no room for. One owner. Allocates
/// nothing, throws nothing after it was opened.
class UdpSocket {
 public:
  /// Asked of the kernel: half a second of a VLS-128 in dual return mode.
  static constexpr int kWantedBufferBytes = 8 << 20;
  static constexpr std::size_t kBatch = 32;

  /// Listens to `port` on every interface. Fails with one line for the user.
  static Expected<UdpSocket, std::string> open(std::uint16_t port);

  /// As open(), shared (SO_REUSEPORT) with other sockets of the same user that ask for it, too. Each of them gets what
  /// is broadcast; what is sent to this host alone one of them gets.
  static Expected<UdpSocket, std::string> open_beside_others(std::uint16_t port);

  /// Takes over a socket that somebody else has bound, e.g. systemd. Fails with one line for the user.
  static Expected<UdpSocket, std::string> adopt(int descriptor);

  ~UdpSocket();
  UdpSocket(UdpSocket&& other) noexcept;
  UdpSocket& operator=(UdpSocket&&) = delete;

  /// Joins a multicast group on every interface that has multicast, to be repeated as interfaces come up. Whether any
  /// has. Any thread.
  bool join(std::uint32_t group_host_order) const; // NOLINT(modernize-use-nodiscard)

  /// Has the kernel drop datagrams before they take room, as a program of socket filters says; none: no more. Whether
  /// it took the program. A socket that was adopted is without one.
  bool filter(std::span<sock_filter> program);

  /// What has come, at most kBatch, in order; valid until the next call. Does not wait.
  std::span<const Datagram> receive();
  /// Brings kernel_drops() and filtered() up to now; receive() does that, too.
  void count_drops();

  [[nodiscard]] int descriptor() const { return descriptor_; }
  [[nodiscard]] std::uint16_t port() const { return port_; }
  /// What the kernel gave of kWantedBufferBytes. It holds as much again for its own book-keeping.
  [[nodiscard]] int buffer_bytes() const { return buffer_bytes_; }
  /// Datagrams that the kernel threw away, because the buffer was full, as count_drops() found them.
  [[nodiscard]] std::uint64_t kernel_drops() const { return kernel_drops_; }
  /// Those that it threw away while there was a filter; what it had no room for then is among them.
  [[nodiscard]] std::uint64_t filtered() const { return filtered_; }

 private:
  struct Batch;

  explicit UdpSocket(int descriptor);
  static Expected<UdpSocket, std::string> open(std::uint16_t port, bool beside_others);
  std::optional<std::string> prepare();

  int descriptor_;
  std::uint16_t port_ = 0;
  int buffer_bytes_ = 0;
  std::uint64_t kernel_drops_ = 0, filtered_ = 0;
  bool has_filter_ = false;
  std::uint32_t last_drops_ = 0; ///< as the kernel counts, in 32 bits
  std::unique_ptr<Batch> batch_;
};

} // namespace locus

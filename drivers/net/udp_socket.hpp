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

/// UDP port that receives lidar packets by unicast, broadcast or multicast.
///
/// The kernel stamps each datagram on arrival and counts those dropped because the buffer was full. Single owner, not
/// thread-safe. After it was opened, allocates nothing and throws nothing.
class UdpSocket {
 public:
  /// Requested receive buffer: half a second of a VLS-128 in dual return mode.
  static constexpr int kWantedBufferBytes = 8 << 20;
  static constexpr std::size_t kBatch = 32;

  /// Binds `port` on all interfaces. Fails with one line for the user.
  static Expected<UdpSocket, std::string> open(std::uint16_t port);

  /// Opens a port shared (SO_REUSEPORT) with other sockets of the same user that also request it. Each receives
  /// broadcasts; a unicast datagram is delivered to only one of them.
  static Expected<UdpSocket, std::string> open_shared(std::uint16_t port);

  /// Takes ownership of a socket bound by another process, e.g. systemd. Fails with one line for the user.
  static Expected<UdpSocket, std::string> adopt(int descriptor);

  ~UdpSocket();
  UdpSocket(UdpSocket&& other) noexcept;
  UdpSocket& operator=(UdpSocket&&) = delete;

  /// Joins a multicast group on all multicast interfaces; call again as interfaces come up. Returns true if any
  /// interface is joined. Thread-safe.
  bool join(std::uint32_t group_host_order) const; // NOLINT(modernize-use-nodiscard)

  /// Attaches a socket filter, so that the kernel drops datagrams before they occupy the buffer; an empty program
  /// removes it. Returns true on success. adopt() removes any existing filter.
  bool filter(std::span<sock_filter> program);

  /// Returns the pending datagrams, at most kBatch, in order; valid until the next call. Does not block.
  std::span<const Datagram> receive();
  /// Updates kernel_drops() and filtered(); receive() calls it too.
  void count_drops();

  [[nodiscard]] int descriptor() const { return descriptor_; }
  [[nodiscard]] std::uint16_t port() const { return port_; }
  /// Part of kWantedBufferBytes that the kernel granted. The kernel adds as much again for its own book-keeping.
  [[nodiscard]] int buffer_bytes() const { return buffer_bytes_; }
  /// Number of datagrams dropped by the kernel because the buffer was full, as of the latest count_drops().
  [[nodiscard]] std::uint64_t kernel_drops() const { return kernel_drops_; }
  /// Number of datagrams dropped while a filter was attached, including those dropped for a full buffer.
  [[nodiscard]] std::uint64_t filtered() const { return filtered_; }

 private:
  struct Batch;

  explicit UdpSocket(int descriptor);
  static Expected<UdpSocket, std::string> open(std::uint16_t port, bool shared);
  std::optional<std::string> prepare();

  int descriptor_;
  std::uint16_t port_ = 0;
  int buffer_bytes_ = 0;
  std::uint64_t kernel_drops_ = 0, filtered_ = 0;
  bool has_filter_ = false;
  std::uint32_t last_drops_ = 0; ///< raw 32-bit counter of the kernel
  std::unique_ptr<Batch> batch_;
};

} // namespace locus

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <variant>
#include <vector>

#include <poll.h>

#include "daemon/input.hpp"
#include "daemon/spsc_ring.hpp"
#include "drivers/net/flood_guard.hpp"
#include "drivers/net/udp_socket.hpp"

namespace locus::daemon {

/// What comes in at this moment: datagrams from all sockets, and what another thread hands over of the motion sources.
///
/// An input that reaches this thread when a later one has been given out arrives after it, by a nanosecond: a sample
/// that another thread was slow to hand over, a datagram of another socket. So inputs come in the order of their
/// arrivals, and a recording of them is played in the same order.
///
/// One thread is the consumer, the ingest; one is the producer of motion, that of the DDS readers, for which one ring
/// for all sources keeps their order.
class LiveInput : public InputSource {
 public:
  using Motion = std::variant<ImuInput, OdometryInput, OutsideVerdict>;
  static constexpr std::size_t kMaxUnread = 1024;

  explicit LiveInput(std::vector<UdpSocket> sockets);
  ~LiveInput() override;
  LiveInput(const LiveInput&) = delete;
  LiveInput& operator=(const LiveInput&) = delete;

  Input next(Duration timeout) override;
  void expect(const LidarRouter& lidars) override;

  /// Producer: lost and counted when the consumer is far behind.
  void push(const Motion& motion) noexcept;

  /// Any thread. Of all sockets; see UdpSocket.
  [[nodiscard]] std::uint64_t kernel_drops() const { return kernel_drops_.load(std::memory_order_relaxed); }
  [[nodiscard]] std::uint64_t filtered() const { return filtered_.load(std::memory_order_relaxed); }
  [[nodiscard]] std::uint64_t motion_drops() const { return motion_drops_.load(std::memory_order_relaxed); }
  [[nodiscard]] std::span<const UdpSocket> sockets() const { return sockets_; } ///< not to be received from

 private:
  [[nodiscard]] std::optional<Input> take_earliest();
  void receive(Duration timeout);
  [[nodiscard]] Stamp in_order(Stamp arrival);

  std::vector<UdpSocket> sockets_;
  std::vector<FloodGuard> guards_;                 ///< by socket
  std::vector<std::span<const Datagram>> waiting_; ///< by socket: received and not given out yet
  std::vector<pollfd> poll_;                       ///< the sockets, then motion_is_there_
  int motion_is_there_;                            ///< eventfd: poll() waits for both
  SpscRing<Motion, kMaxUnread> motion_;
  std::optional<Motion> next_motion_;
  Stamp latest_; ///< arrival given out
  std::atomic<std::uint64_t> kernel_drops_{0}, filtered_{0}, motion_drops_{0};
};

} // namespace locus::daemon

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <variant>
#include <vector>

#include <poll.h>

#include "core/base/source_id.hpp"
#include "core/sources/motion_sample.hpp"
#include "core/sources/sensed_motion.hpp"
#include "daemon/steady_time.hpp"
#include "daemon/threads.hpp"
#include "drivers/clouds/cloud_counters.hpp"
#include "drivers/clouds/cloud_view.hpp"
#include "drivers/net/datagram.hpp"
#include "drivers/net/flood_guard.hpp"
#include "drivers/net/udp_socket.hpp"

namespace locus {
class LidarRouter;
}

namespace locus::daemon {

/// Sample of a motion source. Precondition: it matches the kind of the source.
struct ImuInput {
  SourceId source;
  ImuSample sample;
};
struct OdometryInput {
  SourceId source;
  OdometrySample sample;
};

/// Cloud of the lidar with this index. The message lives as long as a datagram's payload; nullptr for an unreadable
/// one, with the reason in `error`.
struct CloudInput {
  std::uint8_t lidar;
  const CloudView* message;
  Stamp arrival;
  CloudError error{};
};

/// Serialised cloud with encapsulation, on its way to the ingest.
struct CloudBytes {
  static constexpr std::size_t kMaxBytes = 64'000'000; ///< longer messages are rejected

  Stamp arrival;
  std::string_view type = kPointCloudType; ///< as of read_cloud(); static
  bool too_large = false;                  ///< `bytes` is then empty
  std::vector<std::byte> bytes;
};

/// Health of a motion source as reported by an external monitor (health_topic).
struct ExternalHealth {
  SourceId source;
  bool healthy;
};

/// Absence of input until `now`, in arrival time.
struct Silence {
  Stamp now;
};

/// End of a recording: no further input follows.
struct EndOfInput {};

/// Any input of the ingest.
using Input = std::variant<Silence, Datagram, CloudInput, ImuInput, OdometryInput, ExternalHealth, EndOfInput>;

/// Returns the arrival of an input; `otherwise` for inputs without one.
inline Stamp arrival_of(const Input& input, Stamp otherwise) {
  if (const auto* datagram = std::get_if<Datagram>(&input))
    return datagram->receive_stamp;
  if (const auto* cloud = std::get_if<CloudInput>(&input))
    return cloud->arrival;
  if (const auto* imu = std::get_if<ImuInput>(&input))
    return imu->sample.arrival;
  if (const auto* odometry = std::get_if<OdometryInput>(&input))
    return odometry->sample.arrival;
  if (const auto* silence = std::get_if<Silence>(&input))
    return silence->now;
  return otherwise;
}

/// Source of input: sockets and DDS readers in the daemon, a recording in a replay. One owner.
class InputSource {
 public:
  virtual ~InputSource() = default;

  /// Returns the next input in order of arrival, valid until the next call; Silence if none came within `timeout`, with
  /// a time not later than the arrival of the next. Allocates nothing, throws nothing. Not called after EndOfInput.
  virtual Input next(Duration timeout) = 0;

  /// Updates the known lidars, so that the source can filter other senders. Called periodically.
  virtual void update_filter(const LidarRouter& /*lidars*/) {}
};

/// Live input: datagrams from all sockets, and motion samples and clouds handed over by the DDS thread.
///
/// Before an input is returned, every socket that may hold an earlier one is polled, however long the thread was
/// stalled, since a socket returns a limited number of datagrams per call. An input that reaches this thread late,
/// after a newer one was returned (delayed by the other thread or by the kernel), gets an arrival one nanosecond after
/// it. Arrivals are therefore monotonic, and a recording replays in the same order. All stamps are in SteadyTime.
///
/// Consumer: the ingest thread. Producer of motion samples and clouds: the thread of the DDS readers; a single ring for
/// all sources preserves their order.
class LiveInput : public InputSource {
 public:
  using Motion = std::variant<ImuInput, OdometryInput, ExternalHealth>;
  static constexpr std::size_t kMaxUnread = 1024;

  /// Takes the lidar sockets; `gives_clouds` is true for each lidar, by index, that publishes clouds.
  explicit LiveInput(std::vector<UdpSocket> sockets, const std::vector<bool>& gives_clouds = {});
  ~LiveInput() override;
  LiveInput(const LiveInput&) = delete;
  LiveInput& operator=(const LiveInput&) = delete;

  Input next(Duration timeout) override;
  void update_filter(const LidarRouter& lidars) override;

  /// Producer: hands over a sample; drops and counts it if the ring is full.
  void push(const Motion& motion) noexcept;

  /// Producer: returns the buffer for a lidar's next cloud, with the memory of an older one; push_cloud() hands it
  /// over. A cloud not consumed before the next one is dropped and counted. Precondition: the lidar publishes clouds.
  [[nodiscard]] CloudBytes& next_cloud(std::uint8_t lidar) noexcept { return clouds_[lidar]->slot.back(); }
  void push_cloud(std::uint8_t lidar) noexcept;

  /// Any thread: counters over all sockets; see UdpSocket.
  [[nodiscard]] std::uint64_t kernel_drops() const { return kernel_drops_.load(std::memory_order_relaxed); }
  [[nodiscard]] std::uint64_t filtered() const { return filtered_.load(std::memory_order_relaxed); }
  /// Any thread: dropped clouds; 0 for a lidar that sends packets.
  [[nodiscard]] std::uint64_t cloud_drops(std::size_t lidar) const {
    return clouds_[lidar] ? clouds_[lidar]->drops.load(std::memory_order_relaxed) : 0;
  }
  [[nodiscard]] std::uint64_t motion_drops() const { return motion_drops_.load(std::memory_order_relaxed); }
  [[nodiscard]] std::span<const UdpSocket> sockets() const { return sockets_; } ///< callers must not receive
  /// Any thread: converts the returned stamps to the wall clock.
  [[nodiscard]] const SteadyTime& time() const { return time_; }

 private:
  /// State of one lidar that publishes clouds.
  struct Clouds {
    LatestSlot<CloudBytes> slot;
    std::atomic<std::uint64_t> drops{0};
    const CloudBytes* waiting = nullptr; ///< taken from the slot, not yet returned
    SteadyTime::Sender sender;
  };

  /// Location of the next input: a socket, a lidar's cloud, or if neither the motion sample, if any.
  struct Earliest {
    Stamp arrival = Stamp::max();
    std::optional<std::size_t> socket{}, lidar{};
  };

  [[nodiscard]] std::optional<Motion> pop_motion();
  bool poll_clouds();
  [[nodiscard]] Input pop_cloud(std::size_t lidar, Stamp arrival);
  [[nodiscard]] Earliest earliest();
  [[nodiscard]] std::optional<Input> pop(const Earliest& from);
  Stamp receive(Duration timeout);
  [[nodiscard]] bool may_hold_earlier(Stamp arrival) const;
  [[nodiscard]] Stamp monotonic(Stamp arrival);

  std::vector<UdpSocket> sockets_;
  std::vector<FloodGuard> guards_;                 ///< by socket
  std::vector<std::span<const Datagram>> waiting_; ///< by socket: received, not yet returned
  std::vector<Stamp> received_until_;              ///< by socket: datagrams still in it arrived later
  std::vector<pollfd> poll_;                       ///< the sockets, then wakeup_
  int wakeup_;                                  ///< eventfd for motion and clouds, so that poll() waits for all inputs
  std::vector<std::unique_ptr<Clouds>> clouds_; ///< by lidar; nullptr for one that sends packets
  CloudView cloud_;                             ///< cloud returned last
  SpscRing<Motion, kMaxUnread> motion_;
  std::optional<Motion> next_motion_;
  SteadyTime time_;
  std::array<SteadyTime::Sender, kMaxSources> senders_;
  Stamp latest_; ///< arrival of the input returned last
  std::atomic<std::uint64_t> kernel_drops_{0}, filtered_{0}, motion_drops_{0};
};

/// Replays the inputs of a recording at their recorded pace, `speed` times as fast. One owner.
class PacedInput : public InputSource {
 public:
  /// Longest pause that is replayed; a longer step of the arrivals is treated as a clock change.
  static constexpr Duration kMaxPause = std::chrono::seconds{10};

  /// Time source (CLOCK_MONOTONIC) and sleep of this thread, replaceable in tests.
  struct Clock {
    Duration (*now)();
    void (*sleep_for)(Duration);
  };
  static const Clock kHostClock;

  /// Takes a recording that outlives this and whose Silence inputs carry their time. Precondition: speed > 0.
  PacedInput(InputSource& recording, double speed, Clock clock = kHostClock)
      : recording_(recording), speed_(speed), clock_(clock) {}

  Input next(Duration timeout) override;

 private:
  struct PendingInput { ///< input read from the recording, not yet returned
    Input input;
    Stamp arrival;
  };

  void read_ahead();

  InputSource& recording_;
  double speed_;
  Clock clock_;
  std::optional<PendingInput> pending_;
  bool started_ = false;
  Stamp last_arrival_;
  Stamp anchor_arrival_;    ///< reference arrival
  Duration anchor_clock_{}; ///< clock reading at which anchor_arrival_ is due
};

} // namespace locus::daemon

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

/// A sample of a motion source, whose kind it must fit.
struct ImuInput {
  SourceId source;
  ImuSample sample;
};
struct OdometryInput {
  SourceId source;
  OdometrySample sample;
};

/// A cloud of the lidar of this index. The message lives as long as a datagram's payload; nullptr for one that cannot
/// be read, and then why.
struct CloudInput {
  std::uint8_t lidar;
  const CloudView* message;
  Stamp arrival;
  CloudError error{};
};

/// A serialised sensor_msgs/PointCloud2, encapsulation included, on its way to the ingest.
struct CloudBytes {
  static constexpr std::size_t kMost = 64'000'000; ///< longer ones are refused

  Stamp arrival;
  bool too_large = false; ///< and there are no bytes
  std::vector<std::byte> bytes;
};

/// Somebody outside says whether this motion source is healthy (its health_topic).
struct OutsideVerdict {
  SourceId source;
  bool healthy;
};

/// Nothing has come in until `now`, in stamps of arrival.
struct Silence {
  Stamp now;
};

/// Nothing will ever come again; what the end of a recording says.
struct EndOfInput {};

/// All that can reach the ingest.
using Input = std::variant<Silence, Datagram, CloudInput, ImuInput, OdometryInput, OutsideVerdict, EndOfInput>;

/// When it arrived; `otherwise` for what does not tell.
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

/// Where input comes from: sockets and DDS readers in the daemon, a recording in a replay. One owner.
class InputSource {
 public:
  virtual ~InputSource() = default;

  /// The next input in the order of arrival, valid until the next call; Silence if none came within `timeout`, with a
  /// time not later than the arrival of the next. Allocates nothing, throws nothing. After EndOfInput it is not called.
  virtual Input next(Duration timeout) = 0;

  /// To be told now and then of the lidars as they are known by now; for who can tell others from them.
  virtual void expect(const LidarRouter& /*lidars*/) {}
};

/// What comes in at this moment: datagrams from all sockets, and what another thread hands over of the motion sources
/// and of the lidars that give clouds.
///
/// Nothing is given out before every socket was looked at that may hold what came earlier, however long nobody looked:
/// sockets hand out so many datagrams at a time. An input that reaches this thread when a later one has been given out
/// arrives after it, by a nanosecond: a sample that another thread was slow to hand over, a datagram that the kernel
/// was. So inputs come in the order of their arrivals, and a recording of them is played in the same order. All stamps
/// are given out in SteadyTime.
///
/// One thread is the consumer, the ingest; one is the producer of motion and clouds, that of the DDS readers, for which
/// one ring for all sources keeps their order.
class LiveInput : public InputSource {
 public:
  using Motion = std::variant<ImuInput, OdometryInput, OutsideVerdict>;
  static constexpr std::size_t kMaxUnread = 1024;

  /// `gives_clouds`: of each lidar by its index.
  explicit LiveInput(std::vector<UdpSocket> sockets, const std::vector<bool>& gives_clouds = {});
  ~LiveInput() override;
  LiveInput(const LiveInput&) = delete;
  LiveInput& operator=(const LiveInput&) = delete;

  Input next(Duration timeout) override;
  void expect(const LidarRouter& lidars) override;

  /// Producer: lost and counted when the consumer is far behind.
  void push(const Motion& motion) noexcept;

  /// Producer: where the next cloud of a lidar is to be written, over an older one, for its memory; then handed over.
  /// One that is not taken before the next is there is lost and counted. Precondition: the lidar gives clouds.
  [[nodiscard]] CloudBytes& next_cloud(std::uint8_t lidar) noexcept { return clouds_[lidar]->slot.back(); }
  void push_cloud(std::uint8_t lidar) noexcept;

  /// Any thread. Of all sockets; see UdpSocket.
  [[nodiscard]] std::uint64_t kernel_drops() const { return kernel_drops_.load(std::memory_order_relaxed); }
  [[nodiscard]] std::uint64_t filtered() const { return filtered_.load(std::memory_order_relaxed); }
  /// 0 for a lidar that gives no clouds.
  [[nodiscard]] std::uint64_t cloud_drops(std::size_t lidar) const {
    return clouds_[lidar] ? clouds_[lidar]->drops.load(std::memory_order_relaxed) : 0;
  }
  [[nodiscard]] std::uint64_t motion_drops() const { return motion_drops_.load(std::memory_order_relaxed); }
  [[nodiscard]] std::span<const UdpSocket> sockets() const { return sockets_; } ///< not to be received from
  /// Any thread: what is given out, as the clock on the wall has it.
  [[nodiscard]] const SteadyTime& time() const { return time_; }

 private:
  /// Of one lidar that gives clouds.
  struct Clouds {
    LatestSlot<CloudBytes> slot;
    std::atomic<std::uint64_t> drops{0};
    const CloudBytes* waiting = nullptr; ///< taken from the slot, not given out yet
    SteadyTime::Sender sender;
  };

  /// Where the next input is; motion, if it is neither of these, or nothing.
  struct Earliest {
    Stamp arrival = Stamp::max();
    std::optional<std::size_t> socket{}, lidar{};
  };

  [[nodiscard]] std::optional<Motion> take_motion();
  bool look_for_clouds();
  [[nodiscard]] Input give_cloud(std::size_t lidar, Stamp arrival);
  [[nodiscard]] Earliest earliest();
  [[nodiscard]] std::optional<Input> take(const Earliest& from);
  Stamp receive(Duration timeout);
  [[nodiscard]] bool may_hold_earlier(Stamp arrival) const;
  [[nodiscard]] Stamp in_order(Stamp arrival);

  std::vector<UdpSocket> sockets_;
  std::vector<FloodGuard> guards_;                 ///< by socket
  std::vector<std::span<const Datagram>> waiting_; ///< by socket: received and not given out yet
  std::vector<Stamp> received_until_;              ///< by socket: what is still in it arrived later
  std::vector<pollfd> poll_;                       ///< the sockets, then motion_is_there_
  int motion_is_there_;                            ///< eventfd, for clouds too: poll() waits for both
  std::vector<std::unique_ptr<Clouds>> clouds_;    ///< by lidar; nullptr for one that sends packets
  CloudView cloud_;                                ///< given out last
  SpscRing<Motion, kMaxUnread> motion_;
  std::optional<Motion> next_motion_;
  SteadyTime time_;
  std::array<SteadyTime::Sender, kMaxSources> senders_;
  Stamp latest_; ///< arrival given out
  std::atomic<std::uint64_t> kernel_drops_{0}, filtered_{0}, motion_drops_{0};
};

/// Gives the inputs of a recording out when they are due: as they once arrived, `speed` times as fast. One owner.
class PacedInput : public InputSource {
 public:
  /// A step in the stamps of arrival that is longer than this is no pause but another clock, and is not waited for.
  static constexpr Duration kMaxPause = std::chrono::seconds{10};

  /// CLOCK_MONOTONIC and the sleep of this thread, or others in tests.
  struct Clock {
    Duration (*now)();
    void (*sleep_for)(Duration);
  };
  static const Clock kOfTheHost;

  /// `recording` must outlive this; where it is silent, that is for a time it knows. Precondition: speed > 0.
  PacedInput(InputSource& recording, double speed, Clock clock = kOfTheHost)
      : recording_(recording), speed_(speed), clock_(clock) {}

  Input next(Duration timeout) override;

 private:
  struct Held { ///< read from the recording, not given out yet
    Input input;
    Stamp arrival;
  };

  void read_ahead();

  InputSource& recording_;
  double speed_;
  Clock clock_;
  std::optional<Held> held_;
  bool started_ = false;
  Stamp last_arrival_;
  Stamp anchor_arrival_;    ///< this arrival ...
  Duration anchor_clock_{}; ///< ... is due when the clock shows this
};

} // namespace locus::daemon

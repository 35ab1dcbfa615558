// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "config/config.hpp"
#include "drivers/files/motion_files.hpp"
#include "locus_play/motion_publisher.hpp"
#include "locus_play/packet_sender.hpp"
#include "simulated_time/clock_file.hpp"
#include "simulated_time/fault_schedule.hpp"
#include "soak/closed_course.hpp"
#include "soak/looped_course.hpp"

namespace locus::test {

/// The sensors of a robot that drives round a closed course, each at its simulated time, by a thread of its own: lidar
/// by UDP to this host, IMU and wheels by DDS. The lidar's clock is its own; IMU and wheels are stamped by the clock of
/// the host, which may be set.
class RobotSender {
 public:
  /// Precondition: `motion` was made for the same configuration. Both must outlive this.
  RobotSender(const soak::ClosedCourse& course, const Config& config, tools::MotionPublisher& motion,
              const ClockFile& clock);
  ~RobotSender();
  RobotSender(const RobotSender&) = delete;
  RobotSender& operator=(const RobotSender&) = delete;

  /// What is not sent, or is sent twice or late, and what else is. Any thread.
  void set(DayFault fault, bool is_on) { faults_[static_cast<std::size_t>(fault)] = is_on; }

  /// Datagrams to the ports of the lidar, garbage included. Any thread.
  [[nodiscard]] std::uint64_t sent() const { return sent_; }
  /// How late the thread was at the most, since the last call: by how much this machine is too slow. One asks.
  Duration worst_lag();
  /// Where the robot is at this instant, in time that nobody sets (the wall's, less what it was set by). Any thread.
  [[nodiscard]] std::optional<Pose> truth_at(Stamp steady) const;

 private:
  struct Prepared {
    daemon::Input input;
    std::vector<std::byte> payload; ///< of a datagram
  };

  void prepare();
  std::optional<Prepared> take_prepared();
  void run();
  void send(const daemon::Input& input);
  void send(const Datagram& datagram);
  void send_garbage();
  void send_late();
  [[nodiscard]] bool is_on(DayFault fault) const { return faults_[static_cast<std::size_t>(fault)]; }

  Duration lap_;
  Config config_;
  soak::LoopedCourse course_;
  std::vector<StampedPose> truth_;
  tools::MotionPublisher& motion_;
  tools::PacketSender packets_;
  const ClockFile& clock_;
  Duration shift_; ///< from the course to time that nobody sets
  std::array<std::atomic<bool>, kDayFaults> faults_{};
  std::atomic<std::uint64_t> sent_{0};
  std::atomic<std::int64_t> worst_lag_ns_{0}, due_ns_{0};
  std::uint64_t number_ = 0, imus_ = 0;
  std::vector<std::byte> held_back_; ///< of the packet that is overtaken
  Datagram held_datagram_{};
  Duration garbage_until_{};
  int garbage_socket_;
  std::atomic<bool> stopping_{false};
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Prepared> prepared_;
  std::thread preparing_, thread_;
};

} // namespace locus::test

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

/// The sensors of a robot on a closed course. A thread sends each input at its simulated time: lidar packets by UDP to
/// this host, IMU and wheels by DDS. The lidar has its own clock; IMU and wheels are stamped by the host's clock, which
/// may be stepped.
class RobotSender {
 public:
  /// Precondition: `motion` is of the same configuration. Both must outlive this.
  RobotSender(const soak::ClosedCourse& course, const Config& config, tools::MotionPublisher& motion,
              const ClockFile& clock);
  ~RobotSender();
  RobotSender(const RobotSender&) = delete;
  RobotSender& operator=(const RobotSender&) = delete;

  /// Turns a fault of the inputs on or off. Any thread.
  void set(DayFault fault, bool is_on) { faults_[static_cast<std::size_t>(fault)] = is_on; }

  /// Returns the number of datagrams to the lidar ports, garbage included. Any thread.
  [[nodiscard]] std::uint64_t sent() const { return sent_; }
  /// Returns the largest lag of the thread since the previous call, a measure of this machine's overload. Single
  /// caller.
  Duration worst_lag();
  /// Returns the robot's pose at this time, which is the wall clock's without its steps. Any thread.
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
  Duration shift_; ///< from course time to wall time without steps
  std::array<std::atomic<bool>, kDayFaults> faults_{};
  std::atomic<std::uint64_t> sent_{0};
  std::atomic<std::int64_t> worst_lag_ns_{0}, due_ns_{0};
  std::uint64_t number_ = 0, imus_ = 0;
  std::vector<std::byte> held_back_; ///< the packet to be overtaken
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

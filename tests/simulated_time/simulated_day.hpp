// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "simulated_time/clock_file.hpp"
#include "simulated_time/fault_schedule.hpp"
#include "simulated_time/frame_judge.hpp"
#include "simulated_time/listener.hpp"
#include "simulated_time/recent_events.hpp"
#include "simulated_time/robot_computer.hpp"
#include "simulated_time/robot_sender.hpp"
#include "simulated_time/service_judge.hpp"
#include "simulated_time/systemd_stand_in.hpp"

namespace locus::test {

struct DayOptions {
  std::uint64_t seed = 1;
  Duration lasts = std::chrono::hours{24};        ///< simulated
  Duration mean_pause = std::chrono::seconds{30}; ///< between the beginnings of two faults
  std::filesystem::path course_folder;            ///< of the course; simulated where it is not there yet
};

/// A day of the unmodified service under simulated time: its robot drives round, faults befall it as they are
/// scheduled, and what it does is judged all the while. One owner.
class SimulatedDay {
 public:
  /// Preconditions: run_in_simulated_time() was called, this is the only thread, `computer` was made before.
  SimulatedDay(const DayOptions& options, RobotComputer& computer);
  ~SimulatedDay();

  void run();

  /// What should not have been, each with its time.
  [[nodiscard]] const std::vector<std::string>& findings() const { return events_.findings(); }
  /// Of the day: how much of it this machine was too slow for, so that nothing was judged.
  [[nodiscard]] double disturbed_share() const { return events_.disturbed_share(); }
  [[nodiscard]] std::uint64_t estimates_heard() const { return frames_->heard(); }
  [[nodiscard]] std::uint64_t balances() const { return service_->balances(); } ///< of packets sent and accounted for
  [[nodiscard]] int lives() const { return life_; }                             ///< of the service
  [[nodiscard]] std::string summary() const;

 private:
  void look();
  void begin(const ScheduledFault& fault);
  void end(const ScheduledFault& fault);
  void act_on_process(const ScheduledFault& fault, bool begins);
  void reload_configuration(bool broken);
  void measure_lag();
  [[nodiscard]] Duration now() const;

  DayOptions options_;
  RobotComputer& computer_;
  ClockFile clock_;
  Config config_;
  Events events_;
  std::unique_ptr<tools::MotionPublisher> motion_;
  std::unique_ptr<Listener> listener_;
  std::unique_ptr<RobotSender> robot_;
  std::unique_ptr<SystemdStandIn> systemd_;
  std::unique_ptr<FrameJudge> frames_;
  std::unique_ptr<ServiceJudge> service_;
  std::unique_ptr<Child> hanging_, deaf_;
  std::unique_ptr<daemon::DdsWriter<daemon::ros::Odometry>> second_;
  Duration began_{}, system_began_{}, looked_{}, weighed_{};
  int life_ = 0; ///< the latest
  std::uint64_t faults_ = 0;
};

} // namespace locus::test

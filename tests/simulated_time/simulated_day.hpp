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
  std::filesystem::path course_folder;            ///< of the course; simulated if it does not exist yet
};

/// A day of the unmodified service in simulated time: its robot drives laps, scheduled faults occur, and the service is
/// checked continuously. Not thread-safe.
class SimulatedDay {
 public:
  /// Preconditions: run_in_simulated_time() was called, this is the only thread, `computer` already exists.
  SimulatedDay(const DayOptions& options, RobotComputer& computer);
  ~SimulatedDay();

  void run();

  /// Returns all violations, each with its time.
  [[nodiscard]] const std::vector<std::string>& findings() const { return events_.findings(); }
  /// Returns the fraction of the day in which this machine was too slow and no check counted.
  [[nodiscard]] double disturbed_share() const { return events_.disturbed_share(); }
  [[nodiscard]] std::uint64_t estimates_heard() const { return frames_->heard(); }
  [[nodiscard]] std::uint64_t balances() const { return service_->balances(); } ///< comparisons of packet counts
  [[nodiscard]] int lives() const { return life_; }                             ///< processes of the service
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
  int life_ = 0; ///< number of the current process
  std::uint64_t faults_ = 0;
};

} // namespace locus::test

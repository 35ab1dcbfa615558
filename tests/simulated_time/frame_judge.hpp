// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "core/base/pose.hpp"
#include "core/base/stamp.hpp"
#include "simulated_time/clock_file.hpp"
#include "simulated_time/listener.hpp"
#include "simulated_time/recent_events.hpp"
#include "simulated_time/robot_sender.hpp"

namespace locus::test {

/// Checks the published odometry: it is continuous, its stamps are those of the wall clock, its pose is true, and no
/// frame restarts without an announcement. Not thread-safe.
class FrameJudge {
 public:
  FrameJudge(const RobotSender& robot, Events& events) : robot_(robot), events_(events) {}

  /// Checks the estimates received since the previous call.
  void look(Listener& listener, const ClockFile& clock);
  /// The service has restarted, or restarts its odometry at the current pose.
  void begin_life() { life_began_ = events_.now(); }

  [[nodiscard]] double worst_healthy_m() const { return worst_healthy_m_; }
  [[nodiscard]] std::uint64_t heard() const { return heard_; }
  [[nodiscard]] std::uint64_t beginnings() const { return beginnings_; }
  [[nodiscard]] std::uint64_t anew() const { return anew_; }

 private:
  struct Seen {
    Duration at{}; ///< time of reception
    Stamp steady;
    Pose T_odom_base, T_world_base;
  };

  void look_whether_heard();
  void take(const Listener::Estimate& estimate, Duration set_by, Stamp steady);
  void judge(const Seen& seen);
  [[nodiscard]] double bound_m(const Seen& from) const;

  const RobotSender& robot_;
  Events& events_;
  std::deque<Seen> waiting_; ///< judged once an announcement of their frame would have arrived
  std::deque<Seen> before_;
  Duration heard_at_{}, life_began_{}, announced_ = -std::chrono::hours{1};
  Stamp last_beginning_;
  bool told_silence_ = false;
  double worst_healthy_m_ = 0;
  std::uint64_t heard_ = 0, beginnings_ = 0, anew_ = 0;
};

} // namespace locus::test

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

/// Judges what is published: that odometry comes, that its stamps are those of the clock on the wall, that it is where
/// the robot is, and that no frame begins anew unannounced. One owner.
class FrameJudge {
 public:
  FrameJudge(const RobotSender& robot, Events& events) : robot_(robot), events_(events) {}

  /// At what has come since the last look.
  void look(Listener& listener, const ClockFile& clock);
  /// Another life of the service has begun, or it begins its odometry anew where it is.
  void begin_life() { life_began_ = events_.now(); }

  [[nodiscard]] double worst_healthy_m() const { return worst_healthy_m_; }
  [[nodiscard]] std::uint64_t heard() const { return heard_; }
  [[nodiscard]] std::uint64_t beginnings() const { return beginnings_; }
  [[nodiscard]] std::uint64_t anew() const { return anew_; }

 private:
  struct Seen {
    Duration at{}; ///< heard
    Stamp steady;
    Pose T_odom_base, T_world_base;
  };

  void look_whether_heard();
  void take(const Listener::Estimate& estimate, Duration set_by, Stamp steady);
  void judge(const Seen& seen);
  [[nodiscard]] double bound_m(const Seen& from) const;

  const RobotSender& robot_;
  Events& events_;
  std::deque<Seen> waiting_; ///< whether their frame was announced will be known in a moment
  std::deque<Seen> before_;
  Duration heard_at_{}, life_began_{}, announced_ = -std::chrono::hours{1};
  Stamp last_beginning_;
  bool told_silence_ = false;
  double worst_healthy_m_ = 0;
  std::uint64_t heard_ = 0, beginnings_ = 0, anew_ = 0;
};

} // namespace locus::test

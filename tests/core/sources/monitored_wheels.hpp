// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <vector>

#include "core/sources/health_monitor.hpp"

namespace locus::test {

inline const MotionSourceOptions kWheels{.name = "wheels", .kind = SourceKind::odometry, .T_base_source = {}};

/// Wheels at 50 Hz that report 1 m/s, and the faults of their samples on the way to the monitor.
class WheelsTest : public testing::Test {
 protected:
  static constexpr Duration kPeriod = std::chrono::milliseconds{20};

  WheelsTest() { run(std::chrono::seconds{2}); }

  [[nodiscard]] OdometrySample next() {
    now_ += kPeriod;
    x_m_ += 1.0 * to_seconds(kPeriod);
    return {.stamp = now_, .arrival = now_, .T_source_base = {Eigen::Quaterniond::Identity(), {x_m_, 0, 0}}};
  }

  /// Feeds samples for this long, each modified by `worse`.
  template <class Worse> void run(Duration duration, const Worse& worse) {
    for (const Stamp end = now_ + duration; now_ < end;) {
      OdometrySample sample = next();
      worse(sample);
      monitor_.judge(sample);
      note();
    }
  }
  void run(Duration duration) {
    run(duration, [](OdometrySample&) {});
  }

  /// Decelerates at 2 m/s^2, then stands.
  void brake_and_stand(Duration duration) {
    run(duration, [&](OdometrySample& sample) {
      x_m_ = sample.T_source_base.translation.x() = stopping_at_m_ += speed_mps_ * to_seconds(kPeriod);
      speed_mps_ = std::max(0.0, speed_mps_ - 2.0 * to_seconds(kPeriod));
    });
  }

  /// Feeds nothing for this long and advances the time every millisecond.
  void be_silent(Duration duration) {
    for (const Stamp end = now_ + duration; now_ < end;) {
      now_ += std::chrono::milliseconds{1};
      x_m_ += 1e-3;
      monitor_.advance(now_);
      note();
    }
  }

  /// Feeds `sweeps` of 100 ms with this opinion of the lidar.
  void hear(LidarOpinion opinion, int sweeps, const RegistrationFeedback& feedback = {}) {
    for (int i = 0; i < sweeps; ++i) {
      run(std::chrono::milliseconds{100});
      monitor_.on_feedback(opinion, feedback, now_);
      note();
    }
  }

  [[nodiscard]] std::uint64_t left_out(HealthReason reason) const { return monitor_.counters().rejected_as(reason); }

  void expect_lost(HealthReason reason, Duration at_most_after) {
    EXPECT_FALSE(monitor_.healthy());
    ASSERT_EQ(events_.size(), 1U);
    EXPECT_FALSE(events_[0].healthy);
    EXPECT_EQ(events_[0].reason, reason);
    EXPECT_LE(events_[0].stamp - fault_began_, at_most_after);
    EXPECT_GE(left_out(reason), 1U);
  }

  void expect_back_after_probation() {
    run(HealthMonitor::kProbation - std::chrono::milliseconds{20});
    EXPECT_FALSE(monitor_.healthy());
    run(std::chrono::milliseconds{100});
    EXPECT_TRUE(monitor_.healthy());
    EXPECT_EQ(events_.size(), 2U);
    EXPECT_EQ(monitor_.counters().health_changes, 2U);
  }

  void begin_fault() { fault_began_ = now_; }

  HealthMonitor monitor_{kWheels};
  Stamp now_ = stamp_from_ns(1'700'000'000'000'000'000);
  double x_m_ = 0.0;
  double stopping_at_m_ = 2.0, speed_mps_ = 1.0; ///< of brake_and_stand
  Stamp fault_began_;
  std::vector<HealthEvent> events_;

 private:
  void note() {
    if (const auto event = monitor_.pop_event())
      events_.push_back(*event);
  }
};
inline constexpr Duration kDetected = std::chrono::milliseconds{80}; ///< three periods, and the sample before

} // namespace locus::test

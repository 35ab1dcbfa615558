// SPDX-License-Identifier: Apache-2.0
#include "core/imu_self_check.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace locus {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

/// A unit at 200 Hz on a robot that sways left and right, seen by lidar every 100 ms; `wrong` tells what it reports.
class ImuSelfCheckTest : public testing::Test {
 protected:
  template <class Wrong> void drive(ImuSelfCheck& check, Duration duration, const Wrong& wrong) {
    for (int i = 0; i < duration / milliseconds{5}; ++i) {
      now_ += milliseconds{5};
      ImuSample sample{now_, now_, {0.01, 0.02, turn_rate_radps(now_)}, {0.3, 0.1, 9.8}, {}};
      wrong(sample);
      refused_ = check.judge(SourceReading{.stamp = now_, .arrival = now_, .imu = &sample}).has_value();
      if (i % 20 != 19)
        continue;
      RegistrationFeedback seen; // of the sweep before the last: a live pipeline is that late
      seen.to = now_ - milliseconds{100};
      seen.from = seen.to - milliseconds{100};
      seen.twist_base = Vector6::Zero();
      seen.twist_base->tail<3>() = Eigen::Vector3d{0, 0, turn_rate_radps(seen.from + milliseconds{50})};
      check.hear(LidarOpinion::none, seen);
    }
  }
  static double turn_rate_radps(Stamp stamp) {
    return 0.7 * std::sin(2.0 * std::numbers::pi * to_seconds(stamp.time_since_epoch() % seconds{1}));
  }
  Stamp now_ = stamp_from_ns(1'700'000'000'000'000'000);
  bool refused_ = false;
};

TEST_F(ImuSelfCheckTest, AGoodUnitPasses) {
  ImuSelfCheck check(Pose{});
  drive(check, seconds{5}, [](ImuSample&) {});
  EXPECT_FALSE(refused_);
  EXPECT_EQ(check.verdict(), "");
  EXPECT_TRUE(check.trusts_accelerometer());
}

TEST_F(ImuSelfCheckTest, AUnitOnItsSidePassesIfTheConfigurationSaysSo) {
  const Pose T_base_imu{so3_exp({std::numbers::pi / 2, 0, 0}), {}};
  const auto turned = [&](ImuSample& sample) {
    sample.angular_velocity_radps = T_base_imu.rotation.conjugate() * sample.angular_velocity_radps;
    sample.specific_force_mps2 = T_base_imu.rotation.conjugate() * sample.specific_force_mps2;
  };
  ImuSelfCheck configured(T_base_imu), unconfigured(Pose{});
  drive(configured, seconds{5}, turned);
  EXPECT_EQ(configured.verdict(), "");
  drive(unconfigured, seconds{5}, turned);
  EXPECT_TRUE(refused_);
  EXPECT_NE(unconfigured.verdict().find("gravity is not below the robot"), std::string_view::npos);
}

TEST_F(ImuSelfCheckTest, AccelerationsInGAreNotUsedButTheGyroIs) {
  ImuSelfCheck check(Pose{});
  drive(check, seconds{5}, [](ImuSample& sample) { sample.specific_force_mps2 /= 9.81; });
  EXPECT_FALSE(refused_);
  EXPECT_FALSE(check.trusts_accelerometer());
  EXPECT_NE(check.verdict().find("in g"), std::string_view::npos);
}

TEST_F(ImuSelfCheckTest, AccelerationsThatAreNoGravityAreNotUsed) {
  ImuSelfCheck check(Pose{});
  drive(check, seconds{5}, [](ImuSample& sample) { sample.specific_force_mps2 *= 2.0; });
  EXPECT_FALSE(refused_);
  EXPECT_FALSE(check.trusts_accelerometer());
}

TEST_F(ImuSelfCheckTest, AGyroInDegreesIsRefusedByName) {
  ImuSelfCheck check(Pose{});
  drive(check, seconds{5}, [](ImuSample& sample) { sample.angular_velocity_radps /= kRadPerDeg; });
  EXPECT_TRUE(refused_);
  EXPECT_NE(check.verdict().find("deg/s"), std::string_view::npos);
}

TEST_F(ImuSelfCheckTest, AGyroThatTurnsTheOtherWayIsRefused) {
  ImuSelfCheck check(Pose{});
  drive(check, seconds{5}, [](ImuSample& sample) { sample.angular_velocity_radps *= -1.0; });
  EXPECT_TRUE(refused_);
  EXPECT_NE(check.verdict().find("other way"), std::string_view::npos);
}

TEST_F(ImuSelfCheckTest, AGyroThatDoesNotTurnWithTheRobotIsRefused) {
  ImuSelfCheck check(Pose{});
  drive(check, seconds{5}, [](ImuSample& sample) { sample.angular_velocity_radps = {0.5, 0, 0.01}; });
  EXPECT_TRUE(refused_);
}

} // namespace
} // namespace locus

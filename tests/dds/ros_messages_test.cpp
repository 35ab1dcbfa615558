// SPDX-License-Identifier: Apache-2.0
#include "daemon/dds/ros_messages.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <utility>

namespace locus::daemon {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr Stamp kArrival = stamp_from_ns(1'700'000'000'500'000'000);

ros::Imu resting_imu() {
  static std::string frame = "imu_link";
  ros::Imu imu{};
  imu.header_ = {{1'700'000'000, 250'000'000}, frame.data()};
  imu.orientation_.w_ = 1.0;
  imu.linear_acceleration_.z_ = 9.81;
  return imu;
}

ros::Odometry odometry_at(double x_m) {
  static std::string frame;
  ros::Odometry odometry{};
  odometry.header_ = {{1'700'000'000, 250'000'000}, frame.data()};
  odometry.child_frame_id_ = frame.data();
  odometry.pose_.pose_.position_.x_ = x_m;
  odometry.pose_.pose_.orientation_.w_ = 1.0;
  return odometry;
}

std::array<double, 36> covariance(double variance) {
  std::array<double, 36> matrix{};
  for (std::size_t i = 0; i < 6; ++i)
    matrix[7 * i] = variance;
  return matrix;
}

TEST(RosMessages, ImuBecomesASampleInTheSensorsFrame) {
  ros::Imu imu = resting_imu();
  imu.angular_velocity_ = {0.1, 0.2, 0.3};
  const ImuSample sample = to_sample(imu, kArrival);
  EXPECT_EQ(to_ns(sample.stamp), 1'700'000'000'250'000'000);
  EXPECT_EQ(sample.arrival, kArrival);
  EXPECT_EQ(sample.angular_velocity_radps, Eigen::Vector3d(0.1, 0.2, 0.3));
  EXPECT_EQ(sample.specific_force_mps2, Eigen::Vector3d(0, 0, 9.81));
  ASSERT_TRUE(sample.attitude);
  EXPECT_EQ(sample.attitude->w(), 1.0);
}

TEST(RosMessages, ImuWithoutAttitudeIsRecognisedInThreeForms) {
  ros::Imu declared = resting_imu();
  declared.orientation_covariance_[0] = -1.0;
  ros::Imu zero = resting_imu();
  zero.orientation_.w_ = 0.0;
  ros::Imu nan = resting_imu();
  nan.orientation_.x_ = kNan;
  for (const ros::Imu& imu : {declared, zero, nan})
    EXPECT_FALSE(to_sample(imu, kArrival).attitude);
}

TEST(RosMessages, NotANumberIsPassedOn) {
  ros::Imu imu = resting_imu();
  imu.angular_velocity_.y_ = kNan;
  EXPECT_TRUE(std::isnan(to_sample(imu, kArrival).angular_velocity_radps.y()));
  UsualCovariance usual;
  ros::Odometry odometry = odometry_at(kNan);
  EXPECT_FALSE(to_sample(odometry, kArrival, usual).T_source_base.finite());
  odometry = odometry_at(1.0);
  odometry.pose_.pose_.orientation_ = {};
  EXPECT_EQ(to_sample(odometry, kArrival, usual).T_source_base.rotation.norm(), 0.0) << "no rotation at all";
}

TEST(RosMessages, InvalidQuaternionIsPassedOn) {
  UsualCovariance usual;
  ros::Odometry odometry = odometry_at(1.0);
  odometry.pose_.pose_.orientation_ = {0.0, 0.0, 0.3, 0.0}; // w is missing
  EXPECT_EQ(to_sample(odometry, kArrival, usual).T_source_base.rotation.norm(), 0.3);
  odometry.pose_.pose_.orientation_ = {0.0, 0.0, 0.6, 0.8001}; // rounded
  EXPECT_NEAR(to_sample(odometry, kArrival, usual).T_source_base.rotation.norm(), 1.0, 1e-12);
  ros::Imu imu = resting_imu();
  imu.orientation_ = {0.0, 0.0, 0.97, 0.0};
  EXPECT_FALSE(to_sample(imu, kArrival).attitude);
}

TEST(RosMessages, AnyBitsOfAStampConvert) {
  EXPECT_EQ(to_ns(to_stamp({-1, 0})), -1'000'000'000);
  EXPECT_EQ(to_ns(to_stamp({2'147'483'647, 4'294'967'295U})), 2'147'483'647'000'000'000 + 4'294'967'295);
  EXPECT_EQ(to_ns(to_stamp({-2'147'483'648, 0})), -2'147'483'648'000'000'000);
}

TEST(RosMessages, StampsConvertBothWays) {
  for (const std::int64_t ns : {0LL, 1LL, -1LL, 1'700'000'000'999'999'999LL, -1'500'000'000LL}) {
    const ros::Time time = to_ros(stamp_from_ns(ns));
    EXPECT_LT(time.nanosec_, 1'000'000'000U);
    EXPECT_EQ(to_ns(to_stamp(time)), ns);
  }
}

/// Odometry at 50 Hz that moves at 1 m/s, or stands, and reports covariances.
class UsualCovarianceTest : public testing::Test {
 protected:
  double scale(const std::array<double, 36>& covariance, double speed_mps = 1.0) {
    ros::Odometry message = odometry_at(0.0);
    message.header_.stamp_ = to_ros(now_ += std::chrono::milliseconds{20});
    message.twist_.twist_.linear_.x_ = speed_mps;
    std::ranges::copy(covariance, std::begin(message.twist_.covariance_));
    return usual_.scale(message);
  }
  double scale(double variance, double speed_mps = 1.0) { return scale(covariance(variance), speed_mps); }

  UsualCovariance usual_;
  Stamp now_ = kArrival;
};

TEST_F(UsualCovarianceTest, ScaleIsTheRatioToTheUsual) {
  for (int i = 0; i < 100; ++i)
    EXPECT_NEAR(scale(1e-4), 1.0, 1e-9);
  EXPECT_NEAR(scale(1e-3), 10.0, 0.5);
  EXPECT_NEAR(scale(1e-4), 1.0, 0.1);
}

TEST_F(UsualCovarianceTest, UnknownCovarianceIsUsual) {
  for (const double unknown : {0.0, kNan, -1.0, 1e3, 1e6, 1e12, 1e308, std::numeric_limits<double>::max(),
                               std::numeric_limits<double>::infinity()})
    EXPECT_EQ(scale(unknown), 1.0) << unknown;
  EXPECT_NEAR(scale(1e-4), 1.0, 1e-9) << "and teaches nothing";
}

/// Wheels know x and yaw, and drivers fill in the other axes as they like.
TEST_F(UsualCovarianceTest, UnknownAxesDoNotHideTheKnownOnes) {
  for (const double unknown : {0.0, kNan, -1.0, 1e6, std::numeric_limits<double>::max()}) {
    usual_ = {};
    std::array<double, 36> wheels = covariance(unknown);
    wheels[0] = 2e-4;
    wheels[35] = 2e-3;
    for (int i = 0; i < 100; ++i)
      EXPECT_NEAR(scale(wheels), 1.0, 1e-9) << unknown;
    wheels[0] = wheels[35] = 0.1;
    EXPECT_GT(scale(wheels), UsualCovariance::kMaxUsualRatio) << unknown;
  }
}

TEST_F(UsualCovarianceTest, AtRestAndInMotionAreNotCompared) {
  for (const auto& [at_rest, in_motion] : {std::pair{1e-12, 1e-2}, std::pair{1e-2, 1e-12}, std::pair{1e12, 1e-2}}) {
    usual_ = {};
    for (int start = 0; start < 10; ++start) {
      for (int i = 0; i < 500; ++i)
        EXPECT_EQ(scale(at_rest, 0.0), 1.0);
      for (int i = 0; i < 500; ++i)
        EXPECT_NEAR(scale(in_motion), 1.0, 1e-9) << at_rest;
    }
  }
}

/// Some drivers leave the twist zero and report a pose only.
TEST_F(UsualCovarianceTest, MotionIsDetectedInThePoseToo) {
  ros::Odometry message = odometry_at(0.0);
  const auto scale_at = [&](double x_m, double variance) {
    message.header_.stamp_ = to_ros(now_ += std::chrono::milliseconds{20});
    message.pose_.pose_.position_.x_ = x_m;
    std::ranges::copy(covariance(variance), std::begin(message.twist_.covariance_));
    return usual_.scale(message);
  };
  double x_m = 0.0;
  for (int i = 0; i < 100; ++i)
    EXPECT_NEAR(scale_at(x_m += 0.02, 1e-4), 1.0, 1e-9);
  EXPECT_NEAR(scale_at(x_m += 0.02, 1e-3), 10.0, 0.5);
}

/// A visual odometry that loses track reports huge variances on every axis.
TEST_F(UsualCovarianceTest, LossOfAllVariancesIsWorseThanUsual) {
  for (int i = 0; i < 100; ++i)
    scale(1e-4);
  EXPECT_EQ(scale(1e6), std::numeric_limits<double>::infinity());
}

TEST_F(UsualCovarianceTest, LastingChangeBecomesUsual) {
  for (const double lasting : {1.0, 1e9}) {
    usual_ = {};
    for (int i = 0; i < 100; ++i)
      scale(1e-8);
    const Stamp begin = now_;
    while (now_ - begin < UsualCovariance::kAdaptationTime)
      EXPECT_GT(scale(lasting), UsualCovariance::kMaxUsualRatio);
    scale(lasting);
    scale(lasting);
    EXPECT_NEAR(scale(lasting), 1.0, 1e-9) << lasting;
  }
}

TEST(RosMessages, EstimateBecomesOdometryWithFramesAndBothCovariances) {
  OdometryReport report;
  report.stamp = stamp_from_ns(1'700'000'000'123'456'789);
  report.T_odom_base = {from_rpy_rad({0.1, 0.2, 0.3}), {1, 2, 3}};
  report.twist_base << 1, 2, 3, 4, 5, 6;
  report.pose_covariance = Vector6(report.twist_base).asDiagonal();
  report.pose_covariance(0, 5) = 0.25;
  report.twist_covariance(5, 0) = 0.125;
  const FrameNames frames{"odom", "base_link"};
  const ros::Odometry message = to_ros(report, frames);
  EXPECT_EQ(message.header_.stamp_.nanosec_, 123'456'789U);
  EXPECT_STREQ(message.header_.frame_id_, "odom");
  EXPECT_STREQ(message.child_frame_id_, "base_link");
  EXPECT_EQ(message.pose_.pose_.position_.z_, 3.0);
  EXPECT_EQ(message.pose_.pose_.orientation_.w_, report.T_odom_base.rotation.w());
  EXPECT_EQ(message.pose_.covariance_[35], 6.0);
  EXPECT_EQ(message.pose_.covariance_[5], 0.25) << "row-major";
  EXPECT_EQ(message.twist_.covariance_[30], 0.125);
  EXPECT_EQ(message.twist_.twist_.angular_.z_, 6.0);
}

TEST(CloudMessage, LayoutMatchesItsFields) {
  CloudMessage cloud;
  const std::vector<CloudMessage::Point> points{{1, 2, 3, 40, -0.05F, 7, 1}, {4, 5, 6, 50, 0, 15, 0}};
  const std::string frame = "base_link";
  const ros::PointCloud2& message = cloud.make(points, kArrival, frame);
  EXPECT_EQ(message.width_, 2U);
  EXPECT_EQ(message.data_._length, message.width_ * message.point_step_);
  EXPECT_EQ(message.row_step_, message.data_._length);
  ASSERT_EQ(message.fields_._length, 7U);
  const auto read = [&](std::size_t field, std::size_t point, auto value) {
    const std::size_t offset = point * message.point_step_ + message.fields_._buffer[field].offset_;
    std::memcpy(&value, message.data_._buffer + offset, sizeof(value));
    return value;
  };
  EXPECT_STREQ(message.fields_._buffer[4].name_, "time");
  EXPECT_EQ(read(4, 0, float{}), -0.05F);
  EXPECT_EQ(read(0, 1, float{}), 4.0F);
  EXPECT_STREQ(message.fields_._buffer[5].name_, "ring");
  EXPECT_EQ(read(5, 1, std::uint16_t{}), 15);
  EXPECT_EQ(cloud.make({}, kArrival, frame).data_._length, 0U);
}

TEST(DiagnosticsMessage, ShowsEveryFigure) {
  const DiagnosticsMessage message(
      {{Diagnostic::Level::warning, "locusd: front", "silent for 2 s", {{"packets.lost", "3"}, {"rpm", "600"}}},
       {Diagnostic::Level::ok, "locusd: sweeps", "", {}}},
      kArrival);
  const ros::DiagnosticArray& array = message.message();
  ASSERT_EQ(array.status_._length, 2U);
  EXPECT_EQ(array.status_._buffer[0].level_, 1);
  EXPECT_STREQ(array.status_._buffer[0].message_, "silent for 2 s");
  ASSERT_EQ(array.status_._buffer[0].values_._length, 2U);
  EXPECT_STREQ(array.status_._buffer[0].values_._buffer[1].key_, "rpm");
  EXPECT_STREQ(array.status_._buffer[0].values_._buffer[1].value_, "600");
  EXPECT_EQ(array.status_._buffer[1].values_._length, 0U);
}

} // namespace
} // namespace locus::daemon

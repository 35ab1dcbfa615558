// SPDX-License-Identifier: Apache-2.0
#include "trace.hpp"

#include <chrono>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace locus::test {
namespace {

using std::chrono::milliseconds;

/// A robot at 1 m/s along x, with ten sweeps per second.
std::vector<OdometryEstimate> drive(int sweeps) {
  std::vector<OdometryEstimate> estimates;
  for (int i = 0; i < sweeps; ++i) {
    OdometryEstimate estimate;
    estimate.stamp = Stamp{} + milliseconds{1000 + 100 * i};
    estimate.T_odom_base.translation.x() = 0.1 * i;
    estimate.twist_base[0] = 1.0;
    estimate.pose_covariance.diagonal().setConstant(1e-6);
    estimates.push_back(estimate);
  }
  return estimates;
}

Trace trace(const std::vector<OdometryEstimate>& estimates) { return Trace::of("--world none", "0123", estimates); }

TEST(Trace, HasALineEachSecondAndTheLastSweep) {
  const Trace found = trace(drive(45));
  ASSERT_EQ(found.lines.size(), 6U);
  EXPECT_EQ(found.lines[2].t_s, 2.0);
  EXPECT_EQ(found.lines[5].t_s, 4.4);
  EXPECT_EQ(found.sweeps, 45U);
}

TEST(Trace, OfAShortDriveHasEveryOrEveryThirdSweep) {
  EXPECT_EQ(trace(drive(20)).lines.size(), 20U);
  EXPECT_EQ(trace(drive(30)).lines.size(), 11U);
  EXPECT_TRUE(trace({}).lines.empty());
}

TEST(Trace, RoundTrips) {
  const Trace written = trace(drive(45));
  const std::optional<Trace> read = Trace::parse(written.text());
  ASSERT_TRUE(read);
  EXPECT_EQ(read->text(), written.text());
  EXPECT_FALSE(difference(*read, written));
}

TEST(Trace, OtherFilesAreNoTrace) {
  const std::string text = trace(drive(45)).text();
  for (const std::string& other :
       {std::string{}, std::string{"<<<<<<< HEAD\n"} + text, text + "=======\n", text.substr(0, text.size() - 12)})
    EXPECT_FALSE(Trace::parse(other)) << other;
}

TEST(Trace, LastBitOfASweepWithoutLineIsCompared) {
  std::vector<OdometryEstimate> other = drive(45);
  double& x_m = other[13].T_odom_base.translation.x();
  x_m = std::nextafter(x_m, std::numeric_limits<double>::infinity());
  const auto words = difference(trace(drive(45)), trace(other));
  ASSERT_TRUE(words);
  EXPECT_NE(words->find("no line differs"), std::string::npos) << *words;
}

TEST(Trace, FirstDifferenceAndLargestChangesAreNamed) {
  std::vector<OdometryEstimate> other = drive(45);
  other[20].T_odom_base.translation.y() = 0.002;
  other[30].T_odom_base.translation.y() = 0.012;
  other[30].pose_covariance(0, 0) *= 1.21;
  const auto words = difference(trace(drive(45)), trace(other));
  ASSERT_TRUE(words);
  EXPECT_NE(words->find("was    2.000 tracking          2.00000    0.00000"), std::string::npos) << *words;
  EXPECT_NE(words->find("is     2.000 tracking          2.00000    0.00200"), std::string::npos) << *words;
  EXPECT_NE(words->find("position 0.01200 m"), std::string::npos) << *words;
  EXPECT_NE(words->find("sigma 10.0 %"), std::string::npos) << *words;
}

TEST(Trace, AnotherRecordingIsReported) {
  const auto words = difference(trace(drive(45)), Trace::of("--world none", "4567", drive(45)));
  ASSERT_TRUE(words);
  EXPECT_NE(words->find("the recording itself is another one"), std::string::npos) << *words;
}

/// Applies `change` to a line; returns whether the result is within the tolerance.
template <class Change> bool is_within(const Change& change) {
  std::vector<OdometryEstimate> other = drive(45);
  change(other[30]);
  return !difference_beyond(Tolerance{}, trace(drive(45)), trace(other));
}

TEST(Trace, OtherInstructionSetsMayDifferWithinTheTolerance) {
  const Tolerance limit;
  for (const auto& [share, holds] : {std::pair{0.9, true}, std::pair{1.2, false}}) {
    const double part = share;
    EXPECT_EQ(is_within([&](auto& e) { e.T_odom_base.translation.z() += part * limit.position_m; }), holds);
    EXPECT_EQ(is_within([&](auto& e) {
                e.T_odom_base.rotation = from_rpy_rad({0, 0, part * limit.rotation_rad});
              }),
              holds);
    EXPECT_EQ(is_within([&](auto& e) { e.twist_base[1] += part * limit.velocity_mps; }), holds);
    EXPECT_EQ(is_within([&](auto& e) { e.twist_base[5] += part * limit.turn_rate_radps; }), holds);
    EXPECT_EQ(is_within([&](auto& e) { e.pose_covariance(4, 4) *= std::pow(1 + part * limit.sigma_share, 2); }), holds);
  }
  EXPECT_FALSE(is_within([](auto& e) { e.state = TrackingState::degenerate; }));
  EXPECT_FALSE(is_within([](auto& e) { e.pose_covariance(2, 2) = std::nan(""); }));
  EXPECT_TRUE(difference_beyond(Tolerance{}, trace(drive(45)), trace(drive(35))));
}

} // namespace
} // namespace locus::test

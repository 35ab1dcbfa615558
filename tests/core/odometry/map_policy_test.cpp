// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/map_policy.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <utility>

namespace locus {
namespace {

using std::chrono::milliseconds;
using Verdict = MapPolicy::Verdict;

constexpr Duration kEverySweep = milliseconds{100};
constexpr int kPatience = 10; ///< consecutive rejections until the map resumes from the prediction
const MapOptions kMapOptions{.keyframe_m = 1.0, .keyframe_deg = 30.0};

Stamp end_of(int sweep) { return stamp_from_ns(1'000'000'000) + sweep * kEverySweep; }
Pose ahead(double x_m, double yaw_deg = 0.0) { return {from_rpy_rad({0, 0, yaw_deg * kRadPerDeg}), {x_m, 0, 0}}; }

MapPolicy::Outcome placed(int sweep, const Pose& T_odom_base = {}) {
  return {.stamp = end_of(sweep), .T_odom_base = T_odom_base, .accepted = true, .has_points = true};
}
MapPolicy::Outcome refused(int sweep, const Pose& T_odom_base = {}) {
  return {.stamp = end_of(sweep), .T_odom_base = T_odom_base, .accepted = false, .has_points = true};
}
MapPolicy::Outcome carried(MapPolicy::Outcome outcome) {
  outcome.carried = true;
  return outcome;
}

/// A map initialised at the origin by sweep 0, with accepted registrations up to sweep `last`.
MapPolicy policy_begun(int last = 0) {
  MapPolicy policy(kMapOptions);
  policy.begin(end_of(0), Pose{});
  for (int i = 1; i <= last; ++i)
    EXPECT_EQ(policy.judge(placed(i)), Verdict::wait) << "it stands";
  return policy;
}

/// Returns the first sweep at which the policy stops waiting, and its verdict; the last sweep if there is none.
std::pair<int, Verdict> first_that_waits_no_longer(MapPolicy& policy, int from, int to, bool are_carried) {
  for (int i = from; i <= to; ++i)
    if (const Verdict verdict = policy.judge(are_carried ? carried(refused(i)) : refused(i)); verdict != Verdict::wait)
      return {i, verdict};
  return {to, Verdict::wait};
}

TEST(MapPolicy, InsertsAfterAMetreOrThirtyDegrees) {
  MapPolicy policy = policy_begun();
  EXPECT_EQ(policy.judge(placed(1, ahead(0.99))), Verdict::wait);
  EXPECT_EQ(policy.judge(placed(2, ahead(1.01))), Verdict::insert);
  EXPECT_EQ(policy.judge(placed(3, ahead(2.0))), Verdict::wait) << "counted from the last that was taken in";
  EXPECT_EQ(policy.judge(placed(4, ahead(2.0, 29.9))), Verdict::wait);
  EXPECT_EQ(policy.judge(placed(5, ahead(2.0, 30.1))), Verdict::insert);
  EXPECT_EQ(policy.judge(placed(6, ahead(2.0, 0.2))), Verdict::wait);
  EXPECT_EQ(policy.judge(placed(7, ahead(2.0, 0.0))), Verdict::insert) << "back again";
}

TEST(MapPolicy, InsertsNothingThatLacksCorrespondences) {
  MapPolicy policy = policy_begun();
  MapPolicy::Outcome dusty = placed(1, ahead(5.0));
  dusty.lacks_correspondences = true;
  EXPECT_EQ(policy.judge(dusty), Verdict::wait);
  EXPECT_EQ(policy.judge(placed(2, ahead(5.0))), Verdict::insert);
}

MapPolicy::Outcome overlapping(int sweep, double overlap, const Pose& T_odom_base = {}, bool turn_measured = true) {
  MapPolicy::Outcome outcome = placed(sweep, T_odom_base);
  outcome.overlap = overlap;
  outcome.turn_measured = turn_measured;
  return outcome;
}

TEST(MapPolicy, LostOverlapIsAKeyframe) {
  MapPolicy policy(kMapOptions);
  policy.begin(end_of(0), Pose{});
  EXPECT_EQ(policy.judge(overlapping(1, 0.8)), Verdict::wait);
  EXPECT_EQ(policy.judge(overlapping(2, 0.69, ahead(0.0, 6.0))), Verdict::wait) << "0.86 of the best";
  EXPECT_EQ(policy.judge(overlapping(3, 0.67, ahead(0.0, 6.0))), Verdict::insert) << "0.84 of it, after a turn";
  EXPECT_EQ(policy.judge(overlapping(4, 0.67, ahead(0.2, 6.0))), Verdict::wait) << "the best since the last one";
  EXPECT_EQ(policy.judge(overlapping(5, 0.55, ahead(0.2, 6.0))), Verdict::insert) << "after a distance";
}

TEST(MapPolicy, LostOverlapIsNoKeyframeAtRest) {
  MapPolicy policy(kMapOptions);
  policy.begin(end_of(0), Pose{});
  EXPECT_EQ(policy.judge(overlapping(1, 0.8)), Verdict::wait);
  EXPECT_EQ(policy.judge(overlapping(2, 0.4, ahead(0.09, 4.9))), Verdict::wait) << "people in front of it";
}

TEST(MapPolicy, LostOverlapIsNoKeyframeWithoutAMeasuredTurn) {
  MapPolicy policy(kMapOptions);
  policy.begin(end_of(0), Pose{});
  EXPECT_EQ(policy.judge(overlapping(1, 0.8, {}, false)), Verdict::wait);
  EXPECT_EQ(policy.judge(overlapping(2, 0.5, ahead(0.5, 20.0), false)), Verdict::wait);
}

TEST(MapPolicy, InsertsNoRejectedSweep) {
  MapPolicy policy = policy_begun();
  EXPECT_EQ(policy.judge(refused(1, ahead(5.0))), Verdict::wait) << "one sweep against one";
  EXPECT_TRUE(policy.is_refused());
  EXPECT_EQ(policy.judge(placed(2)), Verdict::wait);
  EXPECT_FALSE(policy.is_refused());
}

TEST(MapPolicy, ResumesAtThePredictionAfterTenConsecutiveRejections) {
  MapPolicy policy = policy_begun(50);
  const auto [sweep, verdict] = first_that_waits_no_longer(policy, 51, 100, false);
  EXPECT_EQ(sweep, 50 + kPatience);
  EXPECT_EQ(verdict, Verdict::insert);
  EXPECT_FALSE(policy.is_refused()) << "it counts anew";
}

TEST(MapPolicy, AcceptedSweepResetsTheRejectionCount) {
  MapPolicy policy = policy_begun(50);
  EXPECT_EQ(first_that_waits_no_longer(policy, 51, 59, false).second, Verdict::wait);
  EXPECT_EQ(policy.judge(placed(60)), Verdict::wait);
  EXPECT_EQ(first_that_waits_no_longer(policy, 61, 69, false).second, Verdict::wait);
}

TEST(MapPolicy, EmptySweepsAreNoRejections) {
  MapPolicy policy = policy_begun();
  for (int i = 1; i < 100; ++i) {
    MapPolicy::Outcome empty = refused(i, ahead(0.5 * i));
    empty.has_points = false;
    EXPECT_EQ(policy.judge(empty), Verdict::wait) << i;
    EXPECT_FALSE(policy.is_refused());
  }
}

TEST(MapPolicy, WaitsFiveSecondsWithOdometry) {
  MapPolicy policy = policy_begun(100);
  const auto [sweep, verdict] = first_that_waits_no_longer(policy, 101, 200, true);
  EXPECT_EQ(sweep, 150) << "fifty sweeps since the last that was placed";
  EXPECT_EQ(verdict, Verdict::insert);
}

TEST(MapPolicy, RestartsIfAsManySweepsContradictTheMapAsFit) {
  for (const bool are_carried : {false, true}) {
    MapPolicy policy = policy_begun();
    const auto [sweep, verdict] = first_that_waits_no_longer(policy, 1, 100, are_carried);
    EXPECT_EQ(sweep, kPatience) << are_carried;
    EXPECT_EQ(verdict, Verdict::restart) << "carried or not: " << are_carried;
    const auto [again, same] = first_that_waits_no_longer(policy, sweep + 1, 100, false);
    EXPECT_EQ(again, 2 * kPatience) << "the new one is in doubt as well";
    EXPECT_EQ(same, Verdict::restart);
  }
}

TEST(MapPolicy, MapIsConfirmedOnceMoreSweepsFit) {
  MapPolicy policy = policy_begun(kPatience); // eleven with the first
  EXPECT_EQ(first_that_waits_no_longer(policy, kPatience + 1, 100, false).second, Verdict::insert);
  MapPolicy doubtful = policy_begun(kPatience - 1);
  EXPECT_EQ(first_that_waits_no_longer(doubtful, kPatience, 100, false).second, Verdict::restart);
}

TEST(MapPolicy, MapOfAnotherRunIsNeverDropped) {
  MapPolicy policy(kMapOptions);
  policy.resume();
  policy.begin(end_of(0), Pose{});
  EXPECT_EQ(first_that_waits_no_longer(policy, 1, 100, false), std::pair(kPatience, Verdict::insert));
}

TEST(MapPolicy, ReportsAnAcceptedSweepInTheLastFiveSeconds) {
  const MapPolicy policy = policy_begun();
  EXPECT_TRUE(policy.was_accepted_lately(end_of(49)));
  EXPECT_FALSE(policy.was_accepted_lately(end_of(50)));
  EXPECT_TRUE(policy_begun(10).was_accepted_lately(end_of(59)));
}

} // namespace
} // namespace locus

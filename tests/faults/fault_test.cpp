// SPDX-License-Identifier: Apache-2.0
#include "faults/fault.hpp"

#include <array>

#include <gtest/gtest.h>

#include "support/errors.hpp"

namespace locus {
namespace {

using namespace std::chrono_literals;

Fault parsed(std::string_view text) {
  const Expected<Fault, std::string> fault = Fault::parse(text);
  if (!fault) {
    throw std::invalid_argument(fault.error());
  }
  return *fault;
}

const std::array kTargets{FaultTarget{"front", FaultTarget::Kind::lidar},
                          FaultTarget{"front.position", FaultTarget::Kind::position_packets},
                          FaultTarget{"rear", FaultTarget::Kind::lidar},
                          FaultTarget{"wio", FaultTarget::Kind::odometry}, FaultTarget{"imu", FaultTarget::Kind::imu}};

std::string problem_of(std::string_view text) { return fault_problem(parsed(text), kTargets).value_or(""); }

TEST(Fault, NameKindValueAndWindowAreRead) {
  const Fault fault = parsed("front:packet-loss=2.5@10-20.5");
  EXPECT_EQ(fault.name, "front");
  EXPECT_EQ(fault.kind, FaultKind::packet_loss);
  EXPECT_EQ(fault.value, 2.5);
  EXPECT_EQ(fault.from, 10s);
  EXPECT_EQ(fault.until, 20500ms);
}

TEST(Fault, WithoutAnEndLastsToTheEndOfTheCapture) {
  const Fault fault = parsed("all-lidars:lost@0");
  EXPECT_EQ(fault.from, 0s);
  EXPECT_EQ(fault.until, Duration::max());
}

TEST(Fault, ValuesHaveTheDocumentedDefaults) {
  EXPECT_EQ(parsed("a:jump@1").value, 2.0);
  EXPECT_EQ(parsed("a:late@1").value, 0.2);
  EXPECT_EQ(parsed("a:covariance@1").value, 10.0);
  EXPECT_EQ(parsed("a:clock-step@1").value, 60.0);
  EXPECT_EQ(parsed("a:packet-loss@1").value, 10.0);
  EXPECT_EQ(parsed("a:reorder@1").value, 10.0);
  EXPECT_EQ(parsed("a:duplicate@1").value, 10.0);
  EXPECT_EQ(parsed("a:view@1").value, 180.0);
  EXPECT_EQ(parsed("a:corrupt@1").value, 10.0);
  EXPECT_EQ(parsed("a:clock-step=-3@1").value, -3.0);
}

TEST(Fault, InvalidFaultsAreErrorsThatListTheValidOnes) {
  for (const char* text : {"", "wio", "wio@3", "wio:lost", ":lost@3", "wio@3:lost"}) {
    EXPECT_TRUE(contains(error_of(Fault::parse(text)), "expected NAME:KIND[=VALUE]@T[-T1]")) << text;
  }
  EXPECT_TRUE(contains(error_of(Fault::parse("wio:broken@3")),
                       "unknown kind \"broken\"; known are lost, frozen, jump, nan, late, "
                       "covariance, clock-step, packet-loss, reorder, duplicate, view, corrupt"));
  for (const char* text : {"wio:lost=3@1", "wio:nan=@1"}) {
    EXPECT_TRUE(contains(error_of(Fault::parse(text)), "takes no value")) << text;
  }
  for (const char* text : {"wio:late=@1", "wio:late=x@1", "wio:late=0@1", "wio:late=-1@1", "wio:late=11@1",
                           "wio:late=1s@1", "wio:late=nan@1", "wio:late=inf@1"}) {
    EXPECT_TRUE(contains(error_of(Fault::parse(text)), "the value of late is a number of seconds above 0 and up to 10"))
        << text;
  }
  EXPECT_TRUE(contains(error_of(Fault::parse("front:packet-loss=101@1")), "percent above 0 and up to 100"));
  for (const char* text : {"wio:lost@", "wio:lost@x", "wio:lost@-1", "wio:lost@1-", "wio:lost@2-1", "wio:lost@1-1",
                           "wio:lost@1-2-3", "wio:lost@1,2", "wio:lost@nan", "wio:lost@1e300"}) {
    EXPECT_TRUE(contains(error_of(Fault::parse(text)), "after @ expected T or T-T1")) << text;
  }
}

TEST(Fault, MustFitTheSensorItNames) {
  for (const char* text : {"front:late@1", "all-lidars:clock-step@1", "wio:jump@1", "wio:covariance@1", "imu:nan@1",
                           "imu:frozen@1", "rear:duplicate@1", "imu:jump@1", "front:jump@1", "wio:corrupt@1",
                           "front.position:corrupt@1", "front.position:frozen@1"}) {
    EXPECT_EQ(problem_of(text), "") << text;
  }
  EXPECT_TRUE(contains(problem_of("vio:lost@1"),
                       "no such lidar or source; there are front, front.position, rear, wio, imu, all-lidars"));
  EXPECT_TRUE(
      contains(problem_of("front:nan@1"), "a lidar cannot have it; it can have lost, frozen, jump, late, clock-step"));
  EXPECT_TRUE(contains(problem_of("all-lidars:covariance@1"), "a lidar cannot have it"));
  EXPECT_TRUE(contains(problem_of("imu:covariance@1"), "an IMU cannot have it"));
  EXPECT_TRUE(contains(problem_of("imu:view@1"), "an IMU cannot have it"));
  EXPECT_TRUE(contains(problem_of("front.position:jump@1"), "a position packet cannot have it"));
}

TEST(FaultPlan, WindowIncludesItsBeginningAndExcludesItsEnd) {
  FaultPlan plan{std::array{parsed("wio:lost@1-2")}, stamp_from_ns(0), 1};
  EXPECT_FALSE(plan.judge("wio", false, stamp_from_ns(999'999'999)).lost);
  EXPECT_TRUE(plan.judge("wio", false, stamp_from_ns(1'000'000'000)).lost);
  EXPECT_TRUE(plan.judge("wio", false, stamp_from_ns(1'999'999'999)).lost);
  EXPECT_FALSE(plan.judge("wio", false, stamp_from_ns(2'000'000'000)).lost);
  EXPECT_FALSE(plan.judge("vio", false, stamp_from_ns(1'500'000'000)).lost);
}

TEST(FaultPlan, FaultFromTheStartIncludesTheFirstPacket) {
  FaultPlan plan{std::array{parsed("imu:lost@0-2"), parsed("wio:lost@1-2")}, stamp_from_ns(0), 1};
  const Stamp before = stamp_from_ns(-500'000'000);
  EXPECT_TRUE(plan.judge("imu", false, before).lost);
  EXPECT_FALSE(plan.judge("wio", false, before).lost);
}

TEST(FaultPlan, PositionPacketsHaveFaultsOfTheirLidarAndTheirOwn) {
  FaultPlan plan{std::array{parsed("front:late@0"), parsed("front.position:lost@0")}, stamp_from_ns(0), 1};
  const auto of = [&](const char* stream) { return plan.judge(stream, true, stamp_from_ns(0)); };
  EXPECT_TRUE(of("front.position").lost);
  EXPECT_EQ(of("front.position").delay, 200ms);
  EXPECT_FALSE(of("front").lost);
  EXPECT_TRUE(of("rear.position").harmless());
}

TEST(FaultPlan, AllLidarsAreLidarsOnly) {
  FaultPlan plan{std::array{parsed("all-lidars:lost@0")}, stamp_from_ns(0), 1};
  EXPECT_TRUE(plan.judge("front", true, stamp_from_ns(0)).lost);
  EXPECT_TRUE(plan.judge("rear", true, stamp_from_ns(0)).lost);
  EXPECT_FALSE(plan.judge("wio", false, stamp_from_ns(0)).lost);
}

TEST(FaultPlan, FaultsOfOneSensorCombine) {
  FaultPlan plan{std::array{parsed("wio:late=1@0"), parsed("wio:late=0.5@0"), parsed("wio:jump=3@0")}, stamp_from_ns(0),
                 1};
  const FaultPlan::Verdict verdict = plan.judge("wio", false, stamp_from_ns(0));
  EXPECT_EQ(verdict.delay, 1500ms);
  EXPECT_EQ(verdict.jump, 3.0);
  EXPECT_FALSE(verdict.harmless());
}

TEST(FaultPlan, LosesTheConfiguredShareReproducibly) {
  const auto lost = [](std::uint64_t seed) {
    FaultPlan plan{std::array{parsed("front:packet-loss=20@0")}, stamp_from_ns(0), seed};
    std::vector<int> indices;
    for (int i = 0; i < 10'000; ++i) {
      if (plan.judge("front", true, stamp_from_ns(i)).lost) {
        indices.push_back(i);
      }
    }
    return indices;
  };
  EXPECT_NEAR(static_cast<double>(lost(1).size()), 2000.0, 200.0); // five standard deviations
  EXPECT_EQ(lost(1), lost(1));
  EXPECT_NE(lost(1), lost(2));
}

} // namespace
} // namespace locus

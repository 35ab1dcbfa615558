// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/control.hpp"

#include <gtest/gtest.h>

#include <string>

#include "support/errors.hpp"

namespace locus::daemon {
namespace {

TEST(ControlRequest, IsWhatLocusctlSends) {
  const auto is = [](const char* message, auto kind) {
    const auto request = parse_control_request(message);
    return request && std::holds_alternative<decltype(kind)>(*request);
  };
  EXPECT_TRUE(is(R"({"command": "status"})", ShowStatus{}));
  EXPECT_FALSE(std::get<ShowStatus>(*parse_control_request(R"({"command": "status"})")).as_text);
  EXPECT_TRUE(std::get<ShowStatus>(*parse_control_request(R"({"command": "status", "text": true})")).as_text);
  EXPECT_TRUE(is(R"({"command": "save-map", "more": 1})", SaveMap{}));
  EXPECT_TRUE(is(R"({"command": "reload"})", Reload{}));
  const auto keep = parse_control_request(R"({"command": "record", "keep_s": 60})");
  ASSERT_TRUE(keep);
  EXPECT_EQ(std::get<KeepIncident>(*keep).keep_s, 60);
  const auto flat = parse_control_request(R"({"command": "flat-ground", "mode": "auto"})");
  ASSERT_TRUE(flat);
  EXPECT_EQ(std::get<SetFlatGround>(*flat).mode, FlatGround::automatic);
  const auto reset = parse_control_request(R"({"command": "reset"})");
  ASSERT_TRUE(reset);
  EXPECT_FALSE(std::get<Reset>(*reset).T_odom_base);
  const auto there = parse_control_request(R"({"command": "reset", "pose": [1, -2, 0.5, 0, 0, 90]})");
  ASSERT_TRUE(there);
  const Pose T_odom_base = std::get<Reset>(*there).T_odom_base.value_or(Pose{});
  EXPECT_EQ(T_odom_base.translation, Eigen::Vector3d(1, -2, 0.5));
  EXPECT_NEAR(to_rpy_rad(T_odom_base.rotation).z() / kRadPerDeg, 90, 1e-9);
}

TEST(ControlRequest, WhatLacksSomethingIsNone) {
  for (const char* message :
       {"", "{", "[]", "7", "null", "\xff", "{}", R"({"command": 7})", R"({"command": null})",
        R"({"command": "flat-ground"})", R"({"command": "flat-ground", "mode": 1})", R"({"command": "record"})",
        R"({"command": "record", "keep_s": "60s"})", R"({"command": "reset", "pose": 1})",
        R"({"command": "reset", "pose": [1, 2, 3]})", R"({"command": "reset", "pose": [1, 2, 3, 4, 5, "a"]})",
        R"({"command": "reset", "pose": [1e999, 0, 0, 0, 0, 0]})"})
    EXPECT_TRUE(contains(error_of(parse_control_request(message)), "use locusctl of the same version")) << message;
  EXPECT_FALSE(parse_control_request(std::string(4096, '[')));
  EXPECT_EQ(error_of(parse_control_request(R"({"command": "dance"})")),
            "unknown command dance; use locusctl of the same version");
  EXPECT_EQ(error_of(parse_control_request(R"({"command": "flat-ground", "mode": "maybe"})")),
            "flat-ground must be on, off or auto");
}

TEST(ControlRequest, WhatToKeepIsWithinLimits) {
  for (const char* keep_s : {"0", "-1", "0.99", "600.1", "1e300"})
    EXPECT_EQ(error_of(parse_control_request(R"({"command": "record", "keep_s": )" + std::string(keep_s) + "}")),
              "what to keep must be 1s to 600s")
        << keep_s;
}

TEST(ControlRequest, PoseIsOneThatARobotCanHave) {
  for (const char* pose : {"[1e300, 0, 0, 0, 0, 0]", "[0, -500001, 0, 0, 0, 0]", "[0, 0, 0, 0, 0, 361]"})
    EXPECT_TRUE(contains(error_of(parse_control_request(R"({"command": "reset", "pose": )" + std::string(pose) + "}")),
                         "the pose must lie within 500000 m and 360 degrees"))
        << pose;
}

} // namespace
} // namespace locus::daemon

// SPDX-License-Identifier: Apache-2.0
#include "config/config_proposal.hpp"

#include <gtest/gtest.h>

#include "config/config_yaml.hpp"
#include "support/errors.hpp"

namespace locus::test {
namespace {

TEST(ConfigProposal, ReadsBackToTheSameConfiguration) {
  Config config;
  config.lidars.front().port = 2370;
  config.lidars.front().T_base_lidar = as_written({from_rpy_rad({0.1, 0.2, 0.3}), {1, 2, 3}});
  config.motion_sources.erase(config.motion_sources.begin());
  config.odometry.motion.max_speed_mps = 60;
  config.dds.frame_base = "base_footprint";
  ConfigReasons reasons;
  reasons.of_key["lidars.0.port"] = "where its packets go";
  reasons.of_other_keys = "by --set";
  reasons.other_lidars.push_back({LidarOptions{}, "not mounted"});
  reasons.other_sources.push_back({MotionSource{}, "stands still"});
  const std::string text = print_proposal(config, reasons);
  const auto read = parse_config(text, "proposal");
  ASSERT_TRUE(read) << text;
  EXPECT_EQ(*read, config) << text;
  EXPECT_TRUE(contains(text, "    port: 2370  # where its packets go\n")) << text;
  EXPECT_TRUE(contains(text, "motion:\n  max_speed_mps: 60  # by --set\n")) << text;
  EXPECT_TRUE(contains(text, "  # - name: front  # not used: not mounted\n")) << text;
}

TEST(ConfigProposal, EmptyListHasItsReason) {
  Config config;
  config.motion_sources.clear();
  ConfigReasons reasons;
  reasons.of_key["motion_sources"] = "none found";
  const std::string text = print_proposal(config, reasons);
  EXPECT_TRUE(contains(text, "motion_sources: []  # none found\n")) << text;
  EXPECT_TRUE(parse_config(text, "proposal")) << text;
}

TEST(ConfigProposal, ReasonCannotAddALine) {
  ConfigReasons reasons;
  reasons.of_key["lidars.0.port"] = "a\nthreads: 7";
  const auto read = parse_config(print_proposal(Config{}, reasons), "proposal");
  ASSERT_TRUE(read);
  EXPECT_EQ(*read, Config{});
}

TEST(ConfigProposal, LeftOutSourceRenumbersTheReasonsOfTheOthers) {
  Config config;
  ConfigReasons reasons;
  reasons.of_key["motion_sources.0.topic"] = "of the first";
  reasons.of_key["motion_sources.1.topic"] = "of the second";
  leave_out_source(0, "silent", config, reasons);
  ASSERT_EQ(config.motion_sources.size(), 1U);
  EXPECT_EQ(config.motion_sources.front().name, "imu");
  EXPECT_EQ(reasons.of_key, (std::map<std::string, std::string>{{"motion_sources.0.topic", "of the second"}}));
  ASSERT_EQ(reasons.other_sources.size(), 1U);
  EXPECT_EQ(reasons.other_sources.front().item.name, "wio");
  leave_out_source(0, "", config, reasons);
  EXPECT_EQ(reasons.other_sources.size(), 1U) << "no reason, not listed";
}

} // namespace
} // namespace locus::test

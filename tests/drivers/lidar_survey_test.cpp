// SPDX-License-Identifier: Apache-2.0
#include "drivers/lidar_survey.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <cstdint>

#include "drivers/ouster_test_packet.hpp"

namespace locus {
namespace {

using velodyne::PpsState;

constexpr std::uint32_t kFirstIp = 0x0A000001;
constexpr std::size_t kPpsOffset = 0xCA;

/// Feeds one position packet, and one undecodable data packet: it makes the sender known.
void hear(LidarSurvey& survey, std::uint32_t ip, PpsState pps) {
  std::array<std::byte, velodyne::kPositionPacketBytes> position{};
  position[kPpsOffset] = static_cast<std::byte>(pps);
  survey.add({position, ip, 8308, 8308, Stamp{}});
  const std::array<std::byte, velodyne::kDataPacketBytes> data{};
  survey.add({data, ip, 2368, 2368, Stamp{}});
}

TEST(LidarSurvey, KnownSendersAreFollowedWhenFull) {
  LidarSurvey survey;
  for (std::uint32_t i = 0; i < LidarSurvey::kMaxSenders; ++i)
    hear(survey, kFirstIp + i, PpsState::absent);
  const std::uint32_t one_more = kFirstIp + LidarSurvey::kMaxSenders;
  hear(survey, one_more, PpsState::locked);
  hear(survey, kFirstIp, PpsState::locked);

  const auto lidars = survey.lidars();
  ASSERT_EQ(lidars.size(), LidarSurvey::kMaxSenders);
  EXPECT_EQ(lidars.front().ip, kFirstIp);
  EXPECT_EQ(lidars.front().pps, PpsState::locked);
  EXPECT_EQ(lidars[1].pps, PpsState::absent);
  EXPECT_EQ(lidars.back().ip, one_more - 1);
}

TEST(LidarSurvey, LidarsWithoutADecoderAreNamed) {
  std::array<std::byte, 1248> robosense{};
  for (std::size_t i = 0; i < 4; ++i)
    robosense[i] = std::array{std::byte{0x55}, std::byte{0xAA}, std::byte{0x05}, std::byte{0x5A}}[i];
  LidarSurvey survey;
  for (int i = 0; i < 3; ++i)
    survey.add({robosense, kFirstIp, 6699, 6699, Stamp{}});
  const auto lidars = survey.lidars();
  ASSERT_EQ(lidars.size(), 1U);
  EXPECT_FALSE(lidars.front().is_known());
  ASSERT_TRUE(lidars.front().unknown_packets);
  EXPECT_EQ(to_string(*lidars.front().unknown_packets), "a RoboSense in 3 packets");
}

/// The packets of 128 beams with RNG15 are as long as those of 32 with two returns.
TEST(LidarSurvey, BeamsOfAnOusterAreUnknownIfThePacketsDoNotReportThem) {
  LidarSurvey survey;
  const test::OusterTestPacket bytes{test::ouster_metadata(ouster::Profile::rng15, 128)};
  survey.add({bytes.payload(), kFirstIp, 7502, 7502, Stamp{}});
  const auto lidars = survey.lidars();
  ASSERT_EQ(lidars.size(), 1U);
  EXPECT_TRUE(lidars.front().is_known());
  EXPECT_EQ(lidars.front().beams, 0U);
}

} // namespace
} // namespace locus

// SPDX-License-Identifier: Apache-2.0
#include "drivers/lidar_survey.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <cstdint>

namespace locus {
namespace {

using velodyne::PpsState;

constexpr std::uint32_t kFirstIp = 0x0A000001;
constexpr std::size_t kPpsOffset = 0xCA;

/// Feeds one position packet, and one undecodable data packet: it makes the sender known.
void hear(LidarSurvey& survey, std::uint32_t ip, PpsState pps) {
  std::array<std::byte, velodyne::kPositionPacketBytes> position{};
  position[kPpsOffset] = static_cast<std::byte>(pps);
  survey.take({position, ip, 8308, 8308, Stamp{}});
  const std::array<std::byte, velodyne::kDataPacketBytes> data{};
  survey.take({data, ip, 2368, 2368, Stamp{}});
}

TEST(LidarSurvey, KnownSendersAreFollowedWhenThereIsRoomForNoMore) {
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

} // namespace
} // namespace locus

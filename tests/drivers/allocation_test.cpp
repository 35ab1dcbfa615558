// SPDX-License-Identifier: Apache-2.0
// Memory of the path of the packets: fixed once the first packet of a lidar was decoded.
#include <chrono>
#include <memory>

#include <gtest/gtest.h>

#include "daemon/allocation_counter.hpp"
#include "drivers/hesai/decoder.hpp"
#include "drivers/hesai_test_packet.hpp"
#include "drivers/lidar_input.hpp"
#include "drivers/ouster/decoder.hpp"
#include "drivers/ouster_test_packet.hpp"

namespace locus {
namespace {

using std::chrono::milliseconds;

TEST(Decoders, OfOusterAllocateNothingInAnyProfile) {
  const auto packet = std::make_unique<LidarPacket>();
  for (std::size_t profile = 0; profile < ouster::kProfiles; ++profile) {
    const ouster::Metadata metadata = test::ouster_metadata(static_cast<ouster::Profile>(profile), 128);
    ouster::Decoder decoder{metadata};
    const test::OusterTestPacket good{metadata};
    test::OusterTestPacket bad{metadata};
    bad.set_measurement_id(3, 1023);
    bad.seal();
    const auto before = daemon::allocations();
    EXPECT_EQ(decoder.decode(good.payload(), *packet), std::nullopt);
    EXPECT_EQ(decoder.decode(bad.payload(), *packet), PacketError::azimuth);
    EXPECT_EQ(daemon::allocations(), before) << spec(metadata.profile).name;
  }
}

TEST(Decoders, OfHesaiAllocateNothingForAnyModel) {
  const auto packet = std::make_unique<LidarPacket>();
  for (std::size_t i = 0; i < hesai::kModels; ++i) {
    const auto model = static_cast<hesai::Model>(i);
    hesai::Decoder decoder;
    const test::HesaiTestPacket good{model, 0x39};
    const auto before = daemon::allocations();
    EXPECT_EQ(decoder.decode(good.payload(), *packet), std::nullopt);
    EXPECT_NE(decoder.decode(good.payload().first(100), *packet), std::nullopt);
    EXPECT_EQ(daemon::allocations(), before) << to_string(model);
  }
}

TEST(LidarInput, AllocatesNothingPerPacket) {
  LidarOptions options;
  auto lidar = LidarInput::open(options, 0);
  ASSERT_TRUE(lidar);
  const test::HesaiTestPacket one{hesai::Model::xt32, 0x37};
  const test::HesaiTestPacket next{hesai::Model::xt32, 0x37, test::HesaiTestPacket::kTime + milliseconds{1}};
  const test::OusterTestPacket ouster{test::ouster_metadata()};
  const Stamp arrival{test::HesaiTestPacket::kTime + milliseconds{2}};
  const auto before = daemon::allocations();
  EXPECT_NE(lidar->receive({one.payload(), 1, 2368, 2368, arrival}), nullptr);
  EXPECT_NE(lidar->receive({next.payload(), 1, 2368, 2368, arrival + milliseconds{1}}), nullptr);
  EXPECT_EQ(lidar->receive({ouster.payload(), 1, 2368, 2368, arrival + milliseconds{1}}), nullptr);
  EXPECT_EQ(daemon::allocations(), before);
}

} // namespace
} // namespace locus

// SPDX-License-Identifier: Apache-2.0
#include "drivers/other_maker.hpp"

#include <initializer_list>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "drivers/files/capture.hpp"
#include "drivers/velodyne/model.hpp"
#include "support/test_data.hpp"

namespace locus {
namespace {

std::optional<OtherMaker> maker_of(std::size_t bytes, std::uint16_t port = 2368, int first = 0, int second = 0) {
  std::vector<std::byte> payload(bytes);
  if (bytes >= 2) {
    payload[0] = std::byte(first);
    payload[1] = std::byte(second);
  }
  Datagram datagram;
  datagram.payload = payload;
  datagram.destination_port = port;
  return other_maker(datagram);
}

TEST(OtherMaker, UnsupportedHesaiIsRecognisedByItsPreamble) {
  EXPECT_EQ(maker_of(568, 2368, 0xEE, 0xFF), OtherMaker::hesai);
  EXPECT_EQ(maker_of(1080, 10110, 0xEE, 0xFF), OtherMaker::hesai);
  EXPECT_EQ(maker_of(1256, 2368, 0xFF, 0xEE), OtherMaker::hesai) << "Pandar40: no preamble";
  EXPECT_FALSE(maker_of(1262, 2368, 0xFF, 0xEE)) << "Pandar40P: it is read";
}

TEST(OtherMaker, OusterIsRecognisedByItsPortsAndLengths) {
  EXPECT_EQ(maker_of(48, 7503), OtherMaker::ouster) << "IMU";
  for (const std::size_t bytes : {3392U, 6464U, 12608U, 24896U, 8448U, 16640U, 33024U})
    EXPECT_EQ(maker_of(bytes, 53750), OtherMaker::ouster) << bytes;
}

TEST(OtherMaker, OusterIsRecognisedByTheImuPacketsOfNewFirmware) {
  std::vector<std::byte> imu(452);
  imu[0] = std::byte{2};
  imu[7] = std::byte{1}; // serial number
  const Datagram datagram{imu, 0, 0, 7513, Stamp{}};
  EXPECT_EQ(other_maker(datagram), OtherMaker::ouster);
  EXPECT_TRUE(is_ouster_imu(datagram));
  const std::vector<std::byte> legacy(48);
  EXPECT_TRUE(is_ouster_imu({legacy, 0, 0, 7503, Stamp{}}));
  EXPECT_FALSE(is_ouster_imu({legacy, 0, 0, 7502, Stamp{}}));
}

/// Returns a packet with these bytes, each with its offset, and zeros elsewhere.
std::optional<OtherMaker> maker_by(std::size_t bytes, std::initializer_list<std::pair<std::size_t, int>> values) {
  std::vector<std::byte> payload(bytes);
  for (const auto& [at, value] : values)
    payload[at] = std::byte(value);
  return unsupported_maker(payload);
}

TEST(OtherMaker, LivoxIsRecognisedByVersionLengthAndDataType) {
  EXPECT_EQ(maker_by(1380, {{1, 0x64}, {2, 5}, {5, 96}, {10, 1}}), OtherMaker::livox) << "Mid-360, 96 points of 14";
  EXPECT_EQ(maker_by(804, {{1, 0x24}, {2, 3}, {5, 96}, {10, 2}}), OtherMaker::livox) << "96 points of 8 bytes";
  EXPECT_EQ(maker_by(60, {{1, 60}, {10, 0}}), OtherMaker::livox) << "inertial unit";
  EXPECT_EQ(maker_by(1362, {{0, 5}, {9, 2}}), OtherMaker::livox) << "Avia";
  EXPECT_EQ(maker_by(1318, {{0, 5}}), OtherMaker::livox) << "Mid-40";
  EXPECT_FALSE(maker_by(1380, {{1, 0x64}, {2, 5}, {5, 95}, {10, 1}})) << "another number of points";
  EXPECT_FALSE(maker_by(1380, {{1, 0x64}, {2, 5}, {5, 96}, {10, 4}})) << "unknown data type";
  EXPECT_FALSE(maker_by(1361, {{0, 5}, {9, 2}}));
  EXPECT_FALSE(maker_by(1362, {{0, 5}, {9, 9}}));
  EXPECT_FALSE(maker_by(17, {{0, 5}}));
}

TEST(OtherMaker, RoboSenseAndSeyondAreRecognisedByTheirIdentifiers) {
  EXPECT_EQ(maker_by(1248, {{0, 0x55}, {1, 0xAA}, {2, 0x05}, {3, 0x0A}, {4, 0x5A}, {5, 0xA5}, {6, 0x50}, {7, 0xA0}}),
            OtherMaker::robosense);
  EXPECT_EQ(maker_by(1248, {{0, 0x55}, {1, 0xAA}, {2, 0x05}, {3, 0x5A}}), OtherMaker::robosense);
  EXPECT_EQ(maker_by(1210, {{0, 0x55}, {1, 0xAA}, {2, 0x5A}, {3, 0xA5}}), OtherMaker::robosense);
  EXPECT_EQ(maker_by(1248, {{0, 0xA5}, {1, 0xFF}, {2, 0x00}, {3, 0x5A}}), OtherMaker::robosense);
  EXPECT_FALSE(maker_by(1248, {{0, 0x55}, {1, 0xAA}}));
  EXPECT_EQ(maker_by(512, {{0, 0x6A}, {1, 0x17}, {11, 2}}), OtherMaker::seyond);
  EXPECT_EQ(maker_by(512, {{0, 0x6B}, {1, 0x18}, {11, 2}}), OtherMaker::seyond);
  EXPECT_FALSE(maker_by(512, {{0, 0x6A}, {1, 0x17}})) << "its length is not in it";
  EXPECT_FALSE(maker_by(8, {{0, 0x6A}, {1, 0x17}}));
  EXPECT_FALSE(maker_by(0, {}));
}

TEST(OtherMaker, VelodyneAndUnknownPacketsAreNotRecognised) {
  EXPECT_FALSE(maker_of(velodyne::kDataPacketBytes, 2368, 0xFF, 0xEE));
  EXPECT_FALSE(maker_of(512, 8308));
  EXPECT_FALSE(maker_of(0));
  EXPECT_FALSE(maker_of(1, 2368, 0xEE));
  EXPECT_FALSE(maker_of(1262));
}

TEST(OtherMaker, RecordedOusterIsRecognisedFromItsFirstPacketOn) {
  const auto folder = test::test_data() / "ouster";
  if (!std::filesystem::exists(folder))
    GTEST_SKIP() << "no real captures in " << folder << "; set LOCUS_TEST_DATA";
  for (const char* const name : {"OS-1-32-G_v2.1.1_1024x10.pcap", "OS-0-128-U1_v2.3.0_1024x10.pcap",
                                 "OS-1-128_767798045_1024x10_20230712_120049.pcap", "windowed_frame1.pcap"}) {
    auto capture = Capture::open(folder / name);
    ASSERT_TRUE(capture) << name;
    while (const Datagram* datagram = capture->next())
      EXPECT_EQ(other_maker(*datagram), OtherMaker::ouster) << name;
    EXPECT_GT(capture->datagrams(), 0U) << name;
  }
}

} // namespace
} // namespace locus

// SPDX-License-Identifier: Apache-2.0
#include "drivers/other_maker.hpp"

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

TEST(OtherMaker, HesaiOfAModelThatCannotBeReadIsToldByItsPreamble) {
  EXPECT_EQ(maker_of(568, 2368, 0xEE, 0xFF), OtherMaker::hesai);
  EXPECT_EQ(maker_of(1080, 10110, 0xEE, 0xFF), OtherMaker::hesai);
  EXPECT_EQ(maker_of(1256, 2368, 0xFF, 0xEE), OtherMaker::hesai) << "Pandar40: no preamble";
  EXPECT_FALSE(maker_of(1262, 2368, 0xFF, 0xEE)) << "Pandar40P: it is read";
}

TEST(OtherMaker, OusterIsToldByItsPortsAndLengths) {
  EXPECT_EQ(maker_of(48, 7503), OtherMaker::ouster) << "IMU";
  for (const std::size_t bytes : {3392U, 6464U, 12608U, 24896U, 8448U, 16640U, 33024U})
    EXPECT_EQ(maker_of(bytes, 53750), OtherMaker::ouster) << bytes;
}

TEST(OtherMaker, VelodyneAndStrangersAreNone) {
  EXPECT_FALSE(maker_of(velodyne::kDataPacketBytes, 2368, 0xFF, 0xEE));
  EXPECT_FALSE(maker_of(512, 8308));
  EXPECT_FALSE(maker_of(0));
  EXPECT_FALSE(maker_of(1, 2368, 0xEE));
  EXPECT_FALSE(maker_of(1262));
}

TEST(OtherMaker, RecordedOusterIsToldFromItsFirstPacketOn) {
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

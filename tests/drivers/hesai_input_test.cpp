// SPDX-License-Identifier: Apache-2.0
// Sequences of datagrams from a Hesai lidar at its port.
#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "drivers/hesai_test_packet.hpp"
#include "drivers/lidar_input.hpp"
#include "drivers/lidar_survey.hpp"
#include "drivers/ouster_test_packet.hpp"
#include "drivers/velodyne_test_packet.hpp"

namespace locus::hesai {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;
using test::HesaiTestPacket;

constexpr std::uint32_t kHesaiIp = 0xC0A801C9;
constexpr std::uint8_t kHesaiDual = 0x39;

LidarInput opened(const LidarOptions& options = {}) {
  auto lidar = LidarInput::open(options, 0);
  EXPECT_TRUE(lidar) << lidar.error();
  return std::move(*lidar);
}

/// Sends consecutive packets as the lidar does.
class HesaiSender {
 public:
  explicit HesaiSender(Model model, Duration clock_ahead = {}) : model_(model), clock_ahead_(clock_ahead) {}

  const LidarPacket* send(LidarInput& lidar, std::uint32_t number, bool tells_number = true) {
    const Duration passed =
        static_cast<Duration::rep>(number) * hesai::packet_duration(model_, hesai::ReturnMode::dual);
    const auto turned_cdeg = static_cast<std::int64_t>(360'000.0 * to_seconds(passed)) % 36'000;
    HesaiTestPacket bytes{model_, kHesaiDual, HesaiTestPacket::kTime + clock_ahead_ + passed,
                          static_cast<std::uint16_t>(turned_cdeg)};
    bytes.set_return(0, 0, 2500, static_cast<std::uint8_t>(number));
    bytes.set_number(number);
    bytes.seal();
    if (!tells_number)
      bytes.leave_out_number();
    const Stamp arrival{HesaiTestPacket::kTime + passed + milliseconds{1}};
    return lidar.receive({bytes.payload(), kHesaiIp, 2368, 2368, arrival});
  }

 private:
  Model model_;
  Duration clock_ahead_;
};

TEST(HesaiInput, IsRecognisedFromItsPackets) {
  for (std::size_t i = 0; i < hesai::kModels; ++i) {
    const auto model = static_cast<Model>(i);
    LidarInput lidar = opened();
    const PacketLengths lengths = lidar.decoder().lengths();
    EXPECT_EQ(std::ranges::count(lengths.of_data(), HesaiTestPacket(model, 0x37).payload().size()), 1)
        << to_string(model) << ": its length is expected";
    HesaiSender sender{model};
    ASSERT_NE(sender.send(lidar, 1), nullptr) << to_string(model);
    EXPECT_EQ(lidar.model(), to_string(model));
    EXPECT_EQ(lidar.return_mode(), "dual");
    EXPECT_DOUBLE_EQ(lidar.decoder().rotation_rate_rpm(), 600.0);
    EXPECT_EQ(lidar.decoder().lengths().count, 1U);
    EXPECT_EQ(lidar.decoder().unknown_packets().has_value(), false);
  }
}

TEST(HesaiInput, WrongMakerIsCorrected) {
  LidarInput lidar = opened();
  const test::VelodyneTestPacket unknown{velodyne::Model::vlp16, velodyne::ReturnMode::strongest};
  std::vector<std::byte> payload(unknown.payload().begin(), unknown.payload().end());
  payload[velodyne::kProductIdOffset] = std::byte{0x77};
  EXPECT_EQ(lidar.receive({payload, kHesaiIp, 2368, 2368, Stamp{HesaiTestPacket::kTime}}), nullptr);
  HesaiSender sender{Model::xt32};
  EXPECT_NE(sender.send(lidar, 1), nullptr);
  EXPECT_EQ(lidar.model(), "XT32");

  LidarInput other = opened();
  HesaiTestPacket odd{Model::xt32, 0x37};
  odd.set_return_mode(0x40);
  EXPECT_EQ(other.receive({odd.payload(), kHesaiIp, 2368, 2368, Stamp{HesaiTestPacket::kTime}}), nullptr);
  EXPECT_EQ(to_string(other.decoder().unknown_packets().value()), "a Hesai XT32 in 1 packets");
  const test::VelodyneTestPacket good{velodyne::Model::vlp16, velodyne::ReturnMode::strongest};
  EXPECT_NE(other.receive({good.payload(), kHesaiIp, 2368, 2368, Stamp{HesaiTestPacket::kTime}}), nullptr);
  EXPECT_EQ(other.model(), "VLP-16");
}

/// A broadcasting lidar is received first. Packets of another sender are accepted only after the first was silent for
/// one second.
TEST(HesaiInput, VelodyneBesideItIsNamedAndDecodedOnceItIsSilent) {
  LidarInput lidar = opened();
  HesaiSender sender{Model::xt32};
  ASSERT_NE(sender.send(lidar, 1), nullptr);
  constexpr std::uint32_t kVelodyneIp = 0xC0A801CA;
  const auto read_after = [&](Duration passed) {
    int read = 0;
    for (int i = 0; i < 10; ++i) { // a clock step is accepted after five packets
      const Duration time = passed + i * microseconds{1327};
      const test::VelodyneTestPacket good{velodyne::Model::vlp16, velodyne::ReturnMode::strongest,
                                          static_cast<std::uint32_t>(time / microseconds{1})};
      read += lidar.receive({good.payload(), kVelodyneIp, 2368, 2368, Stamp{HesaiTestPacket::kTime + time}}) ? 1 : 0;
    }
    return read;
  };
  EXPECT_EQ(read_after(milliseconds{500}), 0);
  EXPECT_EQ(lidar.counters()[PacketError::sender], 10U);
  EXPECT_EQ(lidar.sender().rejected_ip(), kVelodyneIp);
  EXPECT_GT(read_after(seconds{2}), 0);
  EXPECT_EQ(lidar.model(), "VLP-16");
}

TEST(HesaiInput, ConfiguredModelIsEnforcedAndAnotherNamed) {
  LidarOptions options;
  options.hesai = Model::xt16;
  LidarInput lidar = opened(options);
  EXPECT_EQ(configured_model(options), "XT16");
  HesaiSender sender{Model::xt32};
  EXPECT_EQ(sender.send(lidar, 1), nullptr);
  EXPECT_EQ(lidar.counters()[PacketError::model], 1U);
  EXPECT_EQ(lidar.decoder().recognised_model(), "XT32");
  EXPECT_FALSE(lidar.listens_to(8308)) << "it sends no position packets";

  LidarOptions velodyne;
  velodyne.model = velodyne::Model::vlp16;
  LidarInput other = opened(velodyne);
  EXPECT_EQ(sender.send(other, 1), nullptr);
  EXPECT_EQ(other.counters()[PacketError::model], 1U);
  EXPECT_EQ(other.decoder().recognised_model(), "XT32");
}

TEST(HesaiInput, UnsupportedModelIsNamed) {
  std::vector<std::byte> at128(1118);
  for (const auto& [at, value] : {std::pair{0U, 0xEE}, {1U, 0xFF}, {2U, 4}, {3U, 3}})
    at128[at] = static_cast<std::byte>(value);
  LidarInput lidar = opened();
  EXPECT_EQ(lidar.receive({at128, kHesaiIp, 2368, 2368, Stamp{HesaiTestPacket::kTime}}), nullptr);
  EXPECT_EQ(lidar.counters()[PacketError::model], 1U);
  EXPECT_EQ(to_string(lidar.decoder().unknown_packets().value()), "a Hesai AT128 in 1 packets");
}

/// Whatever the lidar is configured as, the maker of what comes to its port is named, with what to do.
TEST(LidarInput, PacketsOfAnotherMakerAreNamedWithTheRemedy) {
  std::vector<std::byte> livox(1380), stranger(8448);
  for (const auto& [at, value] : {std::pair{1U, 0x64}, {2U, 5}, {5U, 96}, {10U, 1}})
    livox[at] = static_cast<std::byte>(value);
  const test::OusterTestPacket ouster{test::ouster_metadata()};
  LidarOptions xt32;
  xt32.hesai = Model::xt32;
  for (const LidarOptions& options : {LidarOptions{}, xt32}) {
    LidarInput lidar = opened(options);
    lidar.receive({stranger, kHesaiIp, 2368, 2368, Stamp{HesaiTestPacket::kTime}});
    EXPECT_EQ(lidar.counters()[PacketError::length], 1U);
    EXPECT_FALSE(lidar.decoder().unknown_packets());
    lidar.receive({livox, kHesaiIp, 2368, 2368, Stamp{HesaiTestPacket::kTime}});
    EXPECT_EQ(lidar.counters()[PacketError::model], 1U);
    EXPECT_EQ(to_string(lidar.decoder().unknown_packets().value()), "a Livox in 1 packets");
    EXPECT_NE(remedy(*lidar.decoder().unknown_packets()).find("key topic"), std::string_view::npos);
    lidar.receive({ouster.payload(), kHesaiIp, 2368, 2368, Stamp{HesaiTestPacket::kTime}});
    EXPECT_EQ(to_string(lidar.decoder().unknown_packets().value()), "an Ouster in 2 packets");
    EXPECT_NE(remedy(*lidar.decoder().unknown_packets()).find("locusctl fetch"), std::string_view::npos);
    EXPECT_EQ(lidar.unknown_last_received(), Stamp{HesaiTestPacket::kTime});
  }
}

TEST(HesaiInput, MissingNumbersCountAsLost) {
  LidarInput lidar = opened();
  HesaiSender sender{Model::xt32};
  for (const std::uint32_t number : {10U, 11U, 15U, 16U})
    EXPECT_NE(sender.send(lidar, number), nullptr);
  EXPECT_EQ(lidar.counters().lost, 3U);
  EXPECT_NE(sender.send(lidar, 13), nullptr) << "overtaken";
  EXPECT_EQ(lidar.counters().lost, 2U);
  EXPECT_EQ(lidar.counters().reordered, 1U);
  EXPECT_EQ(sender.send(lidar, 16), nullptr);
  EXPECT_EQ(lidar.counters()[PacketError::duplicate], 1U);
  EXPECT_NE(sender.send(lidar, 17), nullptr);
  EXPECT_EQ(lidar.counters().lost, 2U);
  EXPECT_EQ(lidar.counters().received, 7U);
}

TEST(HesaiInput, WithoutNumbersLossIsInferredFromStampsAndAzimuths) {
  LidarInput lidar = opened();
  HesaiSender sender{Model::pandar40p};
  for (const std::uint32_t number : {10U, 11U, 15U, 16U})
    EXPECT_NE(sender.send(lidar, number, false), nullptr);
  EXPECT_EQ(lidar.counters().lost, 3U);
}

/// The lidar's first packet here ends 4 columns after its first firing.
TEST(HesaiInput, UtcAndTaiAreTrustedAndAFreeClockFollowsArrival) {
  for (const auto& [ahead, scale] : {std::pair{Duration{}, "UTC"}, std::pair{Duration{seconds{37}}, "TAI"},
                                     std::pair{-Duration{seconds{900'000'000}}, "internal"}}) {
    LidarInput lidar = opened();
    HesaiSender sender{Model::xt32, ahead};
    const LidarPacket* packet = nullptr;
    for (std::uint32_t number = 1; number <= 5; ++number)
      packet = sender.send(lidar, number);
    ASSERT_NE(packet, nullptr);
    EXPECT_EQ(lidar.clock_state(), scale);
    EXPECT_TRUE(lidar.decoder().has_date());
    const Duration time = 5 * microseconds{200} - microseconds{150} + microseconds{6};
    const Duration late = packet->stamp.time_since_epoch() - HesaiTestPacket::kTime - time;
    if (std::string_view{scale} == "internal")
      EXPECT_NEAR(to_seconds(late), 1e-3 - 200e-6 + 144e-6, 1e-6) << "its end is where it arrived";
    else
      EXPECT_EQ(late, Duration{}) << scale;
  }
}

TEST(HesaiSurvey, ReportsModelModeAndClock) {
  LidarSurvey survey;
  for (std::uint32_t number = 1; number <= 11; ++number) {
    const Duration passed = number * milliseconds{1};
    HesaiTestPacket bytes{Model::xt32, kHesaiDual, HesaiTestPacket::kTime + passed};
    survey.add({bytes.payload(), kHesaiIp, 2368, 2369, Stamp{HesaiTestPacket::kTime + passed}});
  }
  std::vector<std::byte> at128(1118);
  for (const auto& [at, value] : {std::pair{0U, 0xEE}, {1U, 0xFF}, {2U, 4}, {3U, 3}})
    at128[at] = static_cast<std::byte>(value);
  survey.add({at128, kHesaiIp + 1, 2368, 2368, Stamp{HesaiTestPacket::kTime}});
  const auto lidars = survey.lidars();
  ASSERT_EQ(lidars.size(), 2U);
  EXPECT_EQ(lidars[0].name(), "XT32 at 192.168.1.201");
  EXPECT_EQ(lidars[0].port, 2369);
  EXPECT_EQ(lidars[0].return_mode, "dual");
  EXPECT_DOUBLE_EQ(lidars[0].rotation_rate_rpm, 600.0);
  EXPECT_NEAR(lidars[0].packets_per_s, 1000.0, 1e-6);
  EXPECT_EQ(lidars[0].clock_state(), "clock UTC");
  EXPECT_TRUE(lidars[0].is_synchronised());
  EXPECT_FALSE(lidars[1].is_known());
  EXPECT_EQ(to_string(lidars[1].unknown_packets.value()), "a Hesai AT128 in 1 packets");
}

} // namespace
} // namespace locus::hesai

// SPDX-License-Identifier: Apache-2.0
// Sequences of datagrams from an Ouster at its port.
#include <algorithm>
#include <cstdint>
#include <fstream>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "drivers/files/capture.hpp"
#include "drivers/lidar_router.hpp"
#include "drivers/lidar_survey.hpp"
#include "drivers/ouster_test_packet.hpp"
#include "support/returns.hpp"
#include "support/temporary_folder.hpp"
#include "support/test_data.hpp"

namespace locus {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;
using test::OusterTestPacket;

constexpr std::uint32_t kOusterIp = 0xA9FE5C9E;
constexpr std::uint32_t kSecondOusterIp = 0xA9FEEE6F;
constexpr Duration kPacketDuration{16 * OusterTestPacket::kColumnNs};
constexpr Stamp kOusterStart{seconds{1'700'000'000}};

nlohmann::json matrix_mm(const Pose& T) {
  const Eigen::Matrix3d R = T.R();
  nlohmann::json rows = nlohmann::json::array();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      rows.push_back(R(row, column));
    rows.push_back(1e3 * T.translation[row]);
  }
  for (const int value : {0, 0, 0, 1})
    rows.push_back(value);
  return rows;
}

std::vector<double> degrees(const std::array<double, ouster::kMaxPixels>& angles_rad, std::size_t count) {
  std::vector<double> angles_deg(count);
  std::transform(angles_rad.begin(), angles_rad.begin() + static_cast<std::ptrdiff_t>(count), angles_deg.begin(),
                 [](double angle) { return angle / kRadPerDeg; });
  return angles_deg;
}

/// Writes the metadata as a sensor would send it.
void write_metadata(const ouster::Metadata& metadata, const std::filesystem::path& file) {
  const nlohmann::json root{
      {"prod_line", metadata.product_line},
      {"prod_sn", std::to_string(metadata.serial_number)},
      {"initialization_id", metadata.init_id},
      {"lidar_mode", std::to_string(metadata.columns_per_frame) + "x" + std::to_string(metadata.frames_per_s)},
      {"beam_altitude_angles", degrees(metadata.altitude_rad, metadata.pixels_per_column)},
      {"beam_azimuth_angles", degrees(metadata.azimuth_rad, metadata.pixels_per_column)},
      {"lidar_origin_to_beam_origin_mm", 1e3 * metadata.beam_origin_radius_m},
      {"lidar_to_sensor_transform", matrix_mm(metadata.T_sensor_lidar)},
      {"imu_to_sensor_transform", matrix_mm(metadata.T_sensor_imu)},
      {"data_format",
       {{"pixels_per_column", metadata.pixels_per_column},
        {"columns_per_packet", metadata.columns_per_packet},
        {"columns_per_frame", metadata.columns_per_frame},
        {"column_window", {metadata.first_column, metadata.last_column}},
        {"udp_profile_lidar", spec(metadata.profile).name},
        {"udp_profile_imu", "LEGACY"}}}};
  std::ofstream{file} << root;
}

class OusterInput : public testing::Test {
 protected:
  LidarOptions options(const ouster::Metadata& metadata = test::ouster_metadata(), const char* name = "front") {
    LidarOptions result;
    result.name = name;
    result.ouster = true;
    result.metadata = (folder_ / (std::string{name} + ".json")).string();
    result.port = 7502;
    write_metadata(metadata, result.metadata);
    return result;
  }
  LidarInput opened(const ouster::Metadata& metadata = test::ouster_metadata()) {
    auto lidar = LidarInput::open(options(metadata), 0);
    EXPECT_TRUE(lidar) << lidar.error();
    return std::move(*lidar);
  }

  test::TemporaryFolder folder_;
};

/// Its datagrams by number, 64 per turn; each is valid until the next.
class OusterStream {
 public:
  explicit OusterStream(const ouster::Metadata& metadata = test::ouster_metadata(), std::uint32_t ip = kOusterIp,
                        Duration sensor_epoch = seconds{500})
      : metadata_(metadata), ip_(ip), epoch_(sensor_epoch) {}

  Datagram operator()(int number) {
    const Duration since = number * kPacketDuration;
    packet_.emplace(metadata_, static_cast<std::size_t>(16 * number) % 1024,
                    static_cast<std::uint64_t>((epoch_ + since).count()), static_cast<std::uint32_t>(number / 64));
    packet_->set_return(3, 5, 10'000);
    packet_->seal();
    return {packet_->payload(), ip_, 7502, 7502, kOusterStart + since + kPacketDuration + microseconds{80}};
  }
  Datagram imu(int number, const Eigen::Vector3f& rate_dps) {
    const Duration since = number * kPacketDuration;
    imu_ = test::ouster_imu_packet(static_cast<std::uint64_t>((epoch_ + since).count()), {0.0F, 0.0F, 1.0F}, rate_dps);
    return {imu_, ip_, 7503, 7503, kOusterStart + since + microseconds{900}};
  }

 private:
  ouster::Metadata metadata_;
  std::uint32_t ip_;
  Duration epoch_;
  std::optional<OusterTestPacket> packet_;
  std::vector<std::byte> imu_;
};

TEST_F(OusterInput, GoodPacketsComeOutStampedAtTheirFirstColumn) {
  LidarInput lidar = opened();
  OusterStream stream;
  EXPECT_EQ(lidar.model(), "");
  for (int i = 0; i < 200; ++i) {
    const Datagram datagram = stream(i);
    const LidarPacket* packet = lidar.receive(datagram);
    ASSERT_NE(packet, nullptr) << i;
    EXPECT_EQ(test::returns_of(*packet).size(), 1U);
    EXPECT_LT(std::chrono::abs(datagram.receive_stamp - packet->stamp - packet->duration), microseconds{3});
  }
  EXPECT_EQ(lidar.counters().received, 200U);
  EXPECT_EQ(lidar.counters().data, 200U);
  EXPECT_EQ(lidar.counters().lost, 0U);
  EXPECT_EQ(lidar.model(), "OS1-32");
  EXPECT_EQ(lidar.return_mode(), "strongest");
  EXPECT_NEAR(lidar.decoder().rotation_rate_rpm(), 600.0, 0.1);
  EXPECT_EQ(lidar.clock_state(), "internal");
  EXPECT_EQ(lidar.sender().ip(), kOusterIp);
}

TEST_F(OusterInput, LostPacketsAreCountedAcrossTurns) {
  for (const int gap : {1, 5, 63, 64, 200}) {
    LidarInput lidar = opened();
    OusterStream stream;
    for (int i = 0; i < 400; ++i) {
      if (i < 50 || i >= 50 + gap) {
        EXPECT_NE(lidar.receive(stream(i)), nullptr);
      }
    }
    EXPECT_EQ(lidar.counters().lost, static_cast<std::uint64_t>(gap)) << gap;
  }
}

/// Columns outside the window are not sent, so they are not lost.
TEST_F(OusterInput, ColumnsOutsideTheWindowAreNotLost) {
  ouster::Metadata metadata = test::ouster_metadata();
  metadata.first_column = 912;
  metadata.last_column = 111; // 14 packets: columns 912 through 1023, and up to 111
  LidarInput lidar = opened(metadata);
  OusterStream stream(metadata);
  std::uint64_t sent = 0;
  for (int i = 0; i < 640; ++i) {
    const bool is_sent = i % 64 >= 57 || i % 64 < 7;
    const bool is_lost = i >= 128 && i < 192;
    if (is_sent && !is_lost) {
      EXPECT_NE(lidar.receive(stream(i)), nullptr);
      ++sent;
    }
  }
  EXPECT_EQ(lidar.counters().data, sent);
  EXPECT_EQ(lidar.counters().lost, 14U) << "one turn";
}

TEST_F(OusterInput, DuplicatesAreRejectedAndOvertakenPacketsUsed) {
  LidarInput lidar = opened();
  OusterStream stream;
  for (int i = 0; i < 20; ++i) {
    EXPECT_NE(lidar.receive(stream(i)), nullptr);
    EXPECT_EQ(lidar.receive(stream(i)), nullptr);
  }
  EXPECT_EQ(lidar.counters()[PacketError::duplicate], 20U);
  EXPECT_NE(lidar.receive(stream(21)), nullptr);
  const LidarPacket* const overtaken = lidar.receive(stream(20));
  ASSERT_NE(overtaken, nullptr);
  EXPECT_EQ(lidar.counters().reordered, 1U);
  EXPECT_EQ(lidar.counters().lost, 0U);
}

TEST_F(OusterInput, ClockStepIsCountedAndTimeContinues) {
  LidarInput lidar = opened();
  OusterStream before, after(test::ouster_metadata(), kOusterIp, seconds{9000});
  for (int i = 0; i < 100; ++i)
    EXPECT_NE(lidar.receive(before(i)), nullptr);
  int refused = 0;
  for (int i = 100; i < 200; ++i) {
    const Datagram datagram = after(i);
    const LidarPacket* const packet = lidar.receive(datagram);
    refused += packet == nullptr ? 1 : 0;
    if (packet != nullptr) {
      EXPECT_LT(std::chrono::abs(datagram.receive_stamp - packet->stamp - packet->duration), milliseconds{1});
    }
  }
  EXPECT_EQ(lidar.counters().clock_steps, 1U);
  EXPECT_LT(refused, 10);
}

TEST_F(OusterInput, PtpTimeIsReadAsTai) {
  LidarInput lidar = opened();
  OusterStream stream(test::ouster_metadata(), kOusterIp,
                      kOusterStart.time_since_epoch() + seconds{37} + microseconds{300});
  for (int i = 0; i < 100; ++i) {
    const LidarPacket* packet = lidar.receive(stream(i));
    ASSERT_NE(packet, nullptr);
    EXPECT_EQ(packet->stamp, kOusterStart + i * kPacketDuration + microseconds{300}) << "its clock is believed";
  }
  EXPECT_EQ(lidar.clock_state(), "TAI");
}

TEST_F(OusterInput, ImuIsStampedByTheColumnsClock) {
  LidarInput lidar = opened();
  OusterStream stream;
  EXPECT_EQ(lidar.receive(stream.imu(0, {10.0F, 0.0F, 0.0F})), nullptr);
  EXPECT_TRUE(lidar.imu_samples().empty()) << "nothing is known of the clock yet";
  for (int i = 0; i < 64; ++i) {
    ASSERT_NE(lidar.receive(stream(i)), nullptr);
    EXPECT_TRUE(lidar.imu_samples().empty());
    const Datagram datagram = stream.imu(i, {0.0F, 0.0F, 90.0F});
    EXPECT_EQ(lidar.receive(datagram), nullptr);
    ASSERT_EQ(lidar.imu_samples().size(), 1U);
    const ImuSample& sample = lidar.imu_samples().front();
    EXPECT_LT(std::chrono::abs(sample.stamp - (kOusterStart + i * kPacketDuration + microseconds{80})),
              microseconds{5});
    EXPECT_EQ(sample.arrival, datagram.receive_stamp);
    EXPECT_NEAR(sample.angular_velocity_radps.z(), 90.0 * kRadPerDeg, 1e-6);
    EXPECT_NEAR(sample.specific_force_mps2.z(), 9.80665, 1e-6);
  }
  EXPECT_EQ(lidar.counters().position, 65U);
  EXPECT_EQ(lidar.counters().data, 64U);
  Datagram truncated = stream.imu(70, {0.0F, 0.0F, 0.0F});
  truncated.truncated = true;
  lidar.receive(truncated);
  EXPECT_TRUE(lidar.imu_samples().empty());
}

TEST_F(OusterInput, EveryDatagramIsCounted) {
  LidarInput lidar = opened();
  OusterStream stream, stranger(test::ouster_metadata(), kSecondOusterIp);
  for (int i = 0; i < 10; ++i) {
    lidar.receive(stream(i));
    lidar.receive(stranger(i));
    Datagram cut = stream(i);
    cut.payload = cut.payload.first(cut.payload.size() - 1);
    lidar.receive(cut);
    cut.payload = {};
    lidar.receive(cut);
  }
  const PacketCounters& counters = lidar.counters();
  EXPECT_EQ(counters[PacketError::length], 20U);
  EXPECT_EQ(counters[PacketError::sender], 10U);
  EXPECT_EQ(lidar.sender().others()[0].ip, kSecondOusterIp);
  EXPECT_EQ(counters.received,
            std::accumulate(counters.rejected.begin(), counters.rejected.end(), counters.data + counters.position));
}

TEST_F(OusterInput, MissingMetadataIsNamedWithItsKey) {
  LidarOptions without;
  without.ouster = true;
  without.metadata = (folder_ / "gone.json").string();
  const auto lidar = LidarInput::open(without, 0);
  ASSERT_FALSE(lidar);
  EXPECT_TRUE(lidar.error().starts_with("lidars.front.metadata: " + without.metadata)) << lidar.error();
  EXPECT_NE(lidar.error().find("locusctl fetch"), std::string::npos);
}

TEST_F(OusterInput, WorksBesideAVelodyneAndReportsItsLengths) {
  LidarOptions velodyne;
  velodyne.name = "rear";
  const auto router = LidarRouter::open({options(), velodyne});
  ASSERT_TRUE(router);
  EXPECT_TRUE(router->lidars()[0].listens_to(7503));
  EXPECT_FALSE(router->lidars()[0].listens_to(8308));
  const auto senders = router->senders_to(7502);
  EXPECT_EQ(senders.count, 0U);
  const auto lengths = senders.all_lengths();
  EXPECT_TRUE(std::ranges::find(lengths, test::ouster_metadata().packet_format().packet_bytes) != lengths.end());
  EXPECT_TRUE(std::ranges::find(lengths, 48U) != lengths.end());
  EXPECT_TRUE(std::ranges::find(lengths, velodyne::kDataPacketBytes) == lengths.end());
}

TEST_F(OusterInput, RouterReportsTheOwnerOfAnImu) {
  ouster::Metadata rear = test::ouster_metadata(ouster::Profile::rng15);
  rear.serial_number = 991'913'000'010;
  LidarOptions second = options(rear, "rear");
  second.port = 7504;
  auto router = LidarRouter::open({options(), second});
  ASSERT_TRUE(router);
  OusterStream front, back(rear, kSecondOusterIp);
  for (int i = 0; i < 3; ++i) {
    ASSERT_NE(router->receive(front(i)), nullptr);
    Datagram datagram = back(i);
    datagram.destination_port = 7504;
    ASSERT_NE(router->receive(datagram), nullptr);
  }
  EXPECT_TRUE(router->imu().samples.empty());
  router->receive(back.imu(3, {0.0F, 0.0F, 1.0F}));
  EXPECT_EQ(router->imu().lidar, 1);
  EXPECT_EQ(router->imu().samples.size(), 1U);
  router->receive(front.imu(3, {0.0F, 0.0F, 1.0F}));
  EXPECT_EQ(router->imu().lidar, 0);
  Datagram foreign = front.imu(4, {0.0F, 0.0F, 1.0F});
  foreign.destination_port = 9999;
  router->receive(foreign);
  EXPECT_TRUE(router->imu().samples.empty());
}

TEST_F(OusterInput, SurveyRecognisesItWithoutMetadata) {
  LidarSurvey survey;
  OusterStream stream;
  for (int i = 0; i < 100; ++i) {
    survey.add(stream(i));
    survey.add(stream.imu(i, {0.0F, 0.0F, 0.0F}));
  }
  const std::vector<SurveyedLidar> surveyed = survey.lidars();
  ASSERT_EQ(surveyed.size(), 1U);
  EXPECT_TRUE(surveyed[0].is_known());
  EXPECT_EQ(surveyed[0].ouster, test::ouster_metadata().serial_number);
  EXPECT_EQ(surveyed[0].port, 7502);
  EXPECT_NEAR(surveyed[0].packets_per_s, 640.0, 1.0);
  EXPECT_EQ(surveyed[0].beams, 32U);
  EXPECT_EQ(surveyed[0].columns_per_turn, 0U) << "the begin of one turn tells no mode";
  for (int i = 100; i < 300; ++i)
    survey.add(stream(i));
  EXPECT_EQ(survey.lidars()[0].columns_per_turn, 1024U);
  EXPECT_NEAR(survey.lidars()[0].rotation_rate_rpm, 600.0, 1.0);
  EXPECT_EQ(survey.lidars()[0].clock_state(), "clock internal");
  EXPECT_EQ(surveyed[0].name(), "Ouster 122201000998 at 169.254.92.158");
}

/// Two sensors send to one port, lidar and IMU packets alike, all of them fragmented.
TEST(OusterCapture, TwoSensorsOnOnePortAreDistinguished) {
  const auto folder = test::test_data() / "ouster";
  if (!std::filesystem::exists(folder / "same_ports_nonlegacy.pcap"))
    GTEST_SKIP() << "no real captures in " << folder << "; set LOCUS_TEST_DATA";
  std::vector<LidarOptions> options(2);
  for (std::size_t i = 0; i < 2; ++i) {
    options[i].name = i == 0 ? "front" : "rear";
    options[i].ouster = true;
    options[i].metadata = (folder / ("same_ports_nonlegacy." + std::to_string(i + 1) + ".json")).string();
    options[i].port = 7502;
    options[i].source_ip = i == 0 ? kOusterIp : kSecondOusterIp;
  }
  auto router = LidarRouter::open(options);
  ASSERT_TRUE(router) << router.error();
  auto capture = Capture::open(folder / "same_ports_nonlegacy.pcap");
  ASSERT_TRUE(capture);
  while (const Datagram* datagram = capture->next())
    router->receive(*datagram);
  EXPECT_EQ(capture->stats().fragments, 22U) << "that complete nothing: 11 of each packet";
  EXPECT_TRUE(capture->warnings().empty());
  for (const LidarInput& lidar : router->lidars()) {
    EXPECT_EQ(lidar.counters().received, 2U) << lidar.options().name;
    EXPECT_EQ(lidar.counters().data, 1U) << lidar.options().name;
    EXPECT_EQ(lidar.counters().position, 1U) << lidar.options().name;
  }
  EXPECT_EQ(router->lidars()[0].model(), "OS0-128");
  EXPECT_EQ(router->lidars()[1].model(), "OS1-64");
}

} // namespace
} // namespace locus

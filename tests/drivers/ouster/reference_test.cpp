// SPDX-License-Identifier: Apache-2.0
// Comparison with the output of the maker's own decoder on its captures.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <numeric>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <nettle/md5.h>
#include <nlohmann/json.hpp>

#include "drivers/files/capture.hpp"
#include "drivers/ouster/checksum.hpp"
#include "drivers/ouster/decoder.hpp"
#include "drivers/ouster/imu_packet.hpp"
#include "drivers/sensor_time.hpp"
#include "drivers/wire.hpp"
#include "support/returns.hpp"
#include "support/test_data.hpp"

namespace locus::ouster {
namespace {

std::filesystem::path ouster_data(const std::string& name) { return test::test_data() / "ouster" / name; }

#define SKIP_WITHOUT(file)                                                                                             \
  if (!std::filesystem::exists(file))                                                                                  \
  GTEST_SKIP() << (file) << " is not there; LOCUS_TEST_DATA names the folder of the real captures"

Metadata metadata_of(const std::string& name) {
  auto metadata = read_metadata(ouster_data(name));
  EXPECT_TRUE(metadata) << metadata.error();
  return metadata ? *metadata : Metadata{};
}

/// Calls `take` with each datagram of a capture.
template <class Take> void for_each_datagram(const std::string& name, const Take& take) {
  auto capture = Capture::open(ouster_data(name));
  ASSERT_TRUE(capture) << capture.error();
  while (const Datagram* datagram = capture->next())
    take(*datagram);
}

class Md5 {
 public:
  Md5() { md5_init(&state_); }
  void take(std::uint64_t value, std::size_t bytes) {
    for (std::size_t i = 0; i < bytes; ++i) {
      const auto byte = static_cast<std::uint8_t>(value >> (8 * i));
      md5_update(&state_, 1, &byte);
    }
  }
  std::string hex() {
    std::array<std::uint8_t, MD5_DIGEST_SIZE> digest;
    md5_digest(&state_, digest.size(), digest.data());
    std::string text;
    for (const std::uint8_t byte : digest)
      text += fmt::format("{:02x}", byte);
    return text;
  }

 private:
  md5_ctx state_;
};

struct Recorded {
  std::string name;
  std::vector<std::pair<std::string, std::pair<std::size_t, std::size_t>>> other_fields; ///< offset, width in a pixel
};

void PrintTo(const Recorded& recorded, std::ostream* out) { *out << recorded.name; }

class OusterDigest : public testing::TestWithParam<Recorded> {};

/// Ranges, reflectivities and times of the decoder are equal to the bit; signal and near infrared, which it does not
/// use, are at the offsets of the profile.
TEST_P(OusterDigest, MatchesTheMakersDecoder) {
  const auto& name = GetParam().name;
  const auto& other_fields = GetParam().other_fields;
  SKIP_WITHOUT(ouster_data(name + ".pcap"));
  const Metadata metadata = metadata_of(name + ".json");
  const PacketFormat format = metadata.packet_format();
  Decoder decoder{metadata};
  LidarPacket packet;
  std::map<std::string, Md5> sums;
  for_each_datagram(name + ".pcap", [&](const Datagram& datagram) {
    if (datagram.payload.size() != format.packet_bytes)
      return;
    ASSERT_EQ(decoder.decode(datagram.payload, packet), std::nullopt);
    const std::size_t groups_per_column = packet.count / format.columns_per_packet;
    ASSERT_EQ(groups_per_column * FiringGroup::kLasers, format.pixels_per_column * format.profile.echoes);
    for (std::size_t pixel = 0; pixel < format.pixels_per_column; ++pixel) {
      for (std::size_t column = 0; column < format.columns_per_packet; ++column) {
        for (std::size_t echo = 0; echo < format.profile.echoes; ++echo) {
          const std::size_t group =
              column * groups_per_column + pixel / FiringGroup::kLasers * format.profile.echoes + echo;
          const std::size_t lane = pixel % FiringGroup::kLasers;
          const FiringGroup& found = packet.storage[group];
          const std::string which = echo == 0 ? "" : "2";
          // A second return equal to the first was dropped.
          const float first_m = packet.storage[group - echo].range_m[lane];
          const std::byte* const at =
              format.pixels_of(format.column(datagram.payload.data(), column)) + pixel * format.profile.pixel_bytes;
          const std::uint32_t said_mm = read_u32(at + 4) & 0x7FFFF;
          const bool is_same = echo == 1 && found.range_m[lane] == 0.0F && said_mm == std::lround(1e3F * first_m);
          sums["RANGE" + which].take(
              static_cast<std::uint64_t>(std::lround(1e3F * (is_same ? first_m : found.range_m[lane]))), 4);
          sums["REFLECTIVITY" + which].take(found.intensity[lane], 1);
        }
        for (const auto& [field, place] : other_fields) {
          const std::byte* const at = format.pixels_of(format.column(datagram.payload.data(), column)) +
                                      pixel * format.profile.pixel_bytes + place.first;
          const unsigned value = place.second == 1 ? std::to_integer<unsigned>(*at) << 4 : read_u16(at);
          sums[field].take(value, 2);
        }
      }
    }
    for (std::size_t column = 0; column < format.columns_per_packet; ++column)
      sums["TIMESTAMP"].take(static_cast<std::uint64_t>(decoder.time().count()) +
                                 static_cast<std::uint64_t>(packet.storage[column * groups_per_column].offset_ns[0]),
                             8);
  });
  const auto digest = nlohmann::json::parse(std::ifstream{ouster_data(name + "_digest.json")});
  ASSERT_GE(sums.size(), 3U + other_fields.size());
  for (auto& [field, sum] : sums)
    EXPECT_EQ(sum.hex(), digest["packet_hash"][field]) << field;
}

INSTANTIATE_TEST_SUITE_P(, OusterDigest,
                         testing::Values(Recorded{"OS-1-32-G_v2.1.1_1024x10",
                                                  {{"SIGNAL", {6, 2}}, {"NEAR_IR", {8, 2}}}},
                                         Recorded{"OS-0-32-U1_v2.2.0_1024x10",
                                                  {{"SIGNAL", {8, 2}}, {"SIGNAL2", {10, 2}}, {"NEAR_IR", {12, 2}}}},
                                         Recorded{"OS-0-128-U1_v2.3.0_1024x10", {{"NEAR_IR", {3, 1}}}}),
                         [](const auto& capture) {
                           std::string name = capture.param.name;
                           std::ranges::replace_if(
                               name, [](unsigned char c) { return std::isalnum(c) == 0; }, '_');
                           return name;
                         });

TEST(OusterReference, MetadataOfEveryFirmwareIsRead) {
  SKIP_WITHOUT(ouster_data("metadata"));
  int read = 0;
  for (const auto& entry : std::filesystem::directory_iterator{ouster_data("metadata")}) {
    if (entry.path().filename().string().starts_with("malformed_"))
      continue;
    const auto metadata = read_metadata(entry.path());
    ASSERT_TRUE(metadata) << metadata.error();
    ++read;
    EXPECT_NEAR(metadata->T_sensor_lidar.translation.z(), 0.037, 0.002);
    const bool is_of_2_5 = entry.path().filename().string().starts_with("2_5_0");
    EXPECT_EQ(metadata->columns_in_window() == metadata->columns_per_frame,
              !is_of_2_5 && entry.path().string().find("col_win") == std::string::npos);
  }
  EXPECT_EQ(read, 26);
}

TEST(OusterReference, MalformedMetadataIsReportedWithItsKey) {
  SKIP_WITHOUT(ouster_data("metadata"));
  const std::vector<std::pair<std::string, std::string>> reasons{
      {"complete_but_all_zeros_legacy", "beam_altitude_angles: holds nothing but zeros"},
      {"garbled_legacy_and_nonlegacy", "sensor_info: this section is missing"},
      {"incomplete_data_format_legacy", "data_format.columns_per_frame: is missing"},
      {"incomplete_data_format_nonlegacy", "lidar_data_format.pixels_per_column: is missing"},
      {"incomplete_no_calref_nonlegacy", "calibration_status: this section is missing"},
      {"incomplete_no_sensor_info_nonlegacy", "sensor_info: this section is missing"},
      {"incorrect_nbeam_angles_legacy_113", "beam_altitude_angles: holds 63 numbers, but a column has 64 pixels"},
      {"legacy_with_calibration_status", "calibration_status: belongs to a file with sections"}};
  for (const auto& [name, reason] : reasons) {
    const auto file = ouster_data("metadata/malformed_" + name + ".json");
    const auto metadata = read_metadata(file);
    ASSERT_FALSE(metadata) << name;
    EXPECT_TRUE(metadata.error().starts_with(file.string() + ": " + reason)) << metadata.error();
  }
}

TEST(OusterReference, ChecksumsOfNewFirmwareAreRight) {
  SKIP_WITHOUT(ouster_data("crc_test.pcap"));
  const Metadata metadata = metadata_of("crc_test.json");
  Decoder decoder{metadata};
  LidarPacket packet;
  int lidar = 0, spoilt = 0;
  for_each_datagram("crc_test.pcap", [&](const Datagram& datagram) {
    if (datagram.payload.size() != metadata.packet_format().packet_bytes)
      return;
    EXPECT_TRUE(has_right_checksum(datagram.payload));
    EXPECT_EQ(decoder.decode(datagram.payload, packet), std::nullopt);
    EXPECT_TRUE(decoder.has_checksums());
    ++lidar;
    std::vector<std::byte> flipped{datagram.payload.begin(), datagram.payload.end()};
    flipped[flipped.size() / 2] ^= std::byte{4};
    spoilt += decoder.decode(flipped, packet) == PacketError::checksum ? 1 : 0;
  });
  EXPECT_EQ(lidar, 34);
  EXPECT_EQ(spoilt, 34);
}

TEST(OusterReference, WindowMatchesTheData) {
  SKIP_WITHOUT(ouster_data("windowed_frame1.pcap"));
  const Metadata metadata = metadata_of("windowed_frame1_0.json");
  ASSERT_EQ(metadata.first_column, 1U);
  ASSERT_EQ(metadata.last_column, 256U);
  EXPECT_EQ(metadata.lidar_port, 53750);
  Decoder decoder{metadata};
  LidarPacket packet;
  std::vector<std::size_t> columns;
  for_each_datagram("windowed_frame1.pcap", [&](const Datagram& datagram) {
    if (datagram.destination_port != metadata.lidar_port)
      return;
    ASSERT_EQ(decoder.decode(datagram.payload, packet), std::nullopt);
    for (std::size_t id = decoder.first_column(); id <= decoder.last_column(); ++id)
      columns.push_back(id);
    EXPECT_EQ(packet.count, 8 * (decoder.last_column() - decoder.first_column() + 1));
    EXPECT_EQ(scale_of(metadata.timestamp_mode == TimestampMode::ptp_1588, decoder.time(), datagram.receive_stamp),
              TimeScale::free_running)
        << "set to PTP, but no master was there";
    // Column 128 of 512 points to the right of the maker's lidar frame, to the left of the sensor's.
    if (decoder.first_column() < 96 || decoder.last_column() > 160)
      return;
    for (const LidarReturn& one : test::returns_of(packet))
      EXPECT_GT(one.y_m, 0.5F * one.range_m);
  });
  std::vector<std::size_t> window(256);
  std::iota(window.begin(), window.end(), 1U);
  EXPECT_EQ(columns, window);
  EXPECT_EQ(decoder.invalid_columns(), 0U);
}

TEST(OusterReference, SafetyProfileIsRead) {
  const std::string name = "OS-1-128_767798045_1024x10_20230712_120049";
  SKIP_WITHOUT(ouster_data(name + ".pcap"));
  const Metadata metadata = metadata_of(name + ".json");
  EXPECT_EQ(metadata.profile, Profile::fusa_rng15_dual);
  Decoder decoder{metadata};
  LidarPacket packet;
  std::size_t packets = 0, returns = 0, refused = 0, valid_columns = 0;
  for_each_datagram(name + ".pcap", [&](const Datagram& datagram) {
    if (datagram.payload.size() != metadata.packet_format().packet_bytes)
      return;
    ++packets;
    const auto error = decoder.decode(datagram.payload, packet);
    refused += error ? 1U : 0U;
    valid_columns += error ? 0U : packet.count / 16;
    for (const LidarReturn& one : error ? std::vector<LidarReturn>{} : test::returns_of(packet)) {
      ++returns;
      EXPECT_LT(one.range_m, 262.2F);
      EXPECT_NEAR(std::hypot(one.x_m, one.y_m, one.z_m), one.range_m, 0.1F);
    }
  });
  EXPECT_EQ(packets, 8U);
  EXPECT_EQ(refused, 0U);
  EXPECT_EQ(valid_columns, 8U * 16U);
  EXPECT_GT(returns, 1000U);
}

TEST(OusterReference, EmptyCaptureIsEmpty) {
  SKIP_WITHOUT(ouster_data("empty_pcap.pcap"));
  EXPECT_EQ(metadata_of("empty_pcap.json").product_line, "OS-2-128");
  int datagrams = 0;
  for_each_datagram("empty_pcap.pcap", [&](const Datagram&) { ++datagrams; });
  EXPECT_EQ(datagrams, 0);
}

TEST(OusterReference, ImuAtRestMeasuresGravityAlone) {
  for (const std::string name : {"OS-0-32-U1_v2.2.0_1024x10", "OS-0-128-U1_v2.3.0_1024x10", "crc_test"}) {
    SKIP_WITHOUT(ouster_data(name + ".pcap"));
    const Metadata metadata = metadata_of(name + ".json");
    ImuMeasurements measurements;
    std::vector<ImuMeasurement> all;
    for_each_datagram(name + ".pcap", [&](const Datagram& datagram) {
      if (datagram.destination_port != 7503)
        return;
      ASSERT_EQ(read_imu_packet(metadata, datagram.payload, measurements), std::nullopt);
      all.insert(all.end(), measurements.all().begin(), measurements.all().end());
    });
    ASSERT_EQ(all.size(), 10U) << name;
    for (std::size_t i = 0; i < all.size(); ++i) {
      EXPECT_NEAR(all[i].specific_force_mps2.norm(), 9.81, 0.7) << name;
      EXPECT_LT(all[i].angular_velocity_radps.norm(), 0.06) << name;
      if (i > 0) {
        EXPECT_NEAR(to_seconds(all[i].time - all[i - 1].time), 0.01, 0.001) << name;
      }
    }
  }
}

TEST(OusterReference, ImuPacketsOfNewFirmwareAreRead) {
  SKIP_WITHOUT(ouster_data("imu_zm_no_lidar.pcap"));
  const Metadata metadata = metadata_of("imu_zm_no_lidar_0.json");
  EXPECT_EQ(metadata.imu_port, 7513);
  Decoder decoder{metadata};
  LidarPacket packet;
  ImuMeasurements measurements;
  std::optional<Duration> last;
  std::size_t count = 0;
  for_each_datagram("imu_zm_no_lidar.pcap", [&](const Datagram& datagram) {
    EXPECT_EQ(decoder.decode(datagram.payload, packet), PacketError::length);
    const auto error = read_imu_packet(metadata, datagram.payload, measurements);
    ASSERT_EQ(!error, datagram.destination_port == metadata.imu_port);
    if (error)
      return;
    count += measurements.count;
    for (const ImuMeasurement& one : measurements.all()) {
      EXPECT_NEAR(one.specific_force_mps2.norm(), 9.81, 0.7);
      EXPECT_LT(one.angular_velocity_radps.norm(), 0.06);
      if (last) {
        EXPECT_NEAR(to_seconds(one.time - *last), 1.0 / 640.0, 5e-4);
      }
      last = one.time;
    }
  });
  EXPECT_EQ(count, 64U);
}

} // namespace
} // namespace locus::ouster

// SPDX-License-Identifier: Apache-2.0
#include "drivers/packet_edit.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <iterator>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/ingest/lidar_packet.hpp"
#include "drivers/hesai/decoder.hpp"
#include "drivers/hesai_test_packet.hpp"
#include "drivers/ouster/checksum.hpp"
#include "drivers/ouster/decoder.hpp"
#include "drivers/ouster/imu_packet.hpp"
#include "drivers/ouster/packet_edit.hpp"
#include "drivers/ouster_test_packet.hpp"
#include "drivers/packet_clock.hpp"
#include "drivers/velodyne/decoder.hpp"
#include "drivers/velodyne/model.hpp"
#include "drivers/velodyne/position_packet.hpp"
#include "drivers/velodyne_test_packet.hpp"
#include "drivers/wire.hpp"
#include "support/returns.hpp"

namespace locus {
namespace {

using namespace std::chrono_literals;
using Bytes = std::vector<std::byte>;

Bytes copy_of(std::span<const std::byte> payload) { return {payload.begin(), payload.end()}; }

/// Returns the valid ranges of a packet in its order.
std::vector<float> ranges_m(const LidarPacket& packet) {
  std::vector<float> ranges;
  for (const FiringGroup& group : packet.firing_groups())
    std::ranges::copy_if(group.range_m, std::back_inserter(ranges), [](float range_m) { return range_m > 0.0F; });
  return ranges;
}

/// Expects a view of 90 degrees to leave exactly the returns ahead, judged by the decoded points. The packet holds one
/// return.
template <class Decoder>
void expect_only_ahead(std::span<const std::byte> payload, const ouster::Metadata* metadata, Decoder decoder) {
  Bytes bytes = copy_of(payload);
  LidarPacket packet;
  ASSERT_EQ(decoder.decode(bytes, packet), std::nullopt);
  const std::vector<LidarReturn> before = test::returns_of(packet);
  ASSERT_EQ(before.size(), 1U);
  const double away_deg =
      std::abs(std::atan2(static_cast<double>(before[0].y_m), static_cast<double>(before[0].x_m))) / kRadPerDeg;
  constexpr double kBesideItsColumn_deg = 6; // direction of a laser relative to its column
  if (std::abs(away_deg - 45) < kBesideItsColumn_deg)
    return;
  narrow_view(bytes, metadata, 90);
  ASSERT_EQ(decoder.decode(bytes, packet), std::nullopt) << "and it has its checksum";
  EXPECT_EQ(ranges_m(packet).size(), away_deg < 45 ? 1U : 0U) << away_deg;
}

/// The packets of all Ouster's profiles.
class PacketEditOfOuster : public testing::TestWithParam<std::size_t> {
 protected:
  PacketEditOfOuster() : metadata_(test::ouster_metadata(static_cast<ouster::Profile>(GetParam()))) {
    test::OusterTestPacket packet{metadata_, 0, static_cast<std::uint64_t>(kTime.count())};
    packet.set_return(1, 5, 10'000, 77);
    if (metadata_.packet_format().profile.echoes > 1)
      packet.set_return(1, 5, 12'000, 78, 1);
    packet.set_valid(2, false);
    packet.set_time(2, 0);
    packet.seal();
    bytes_ = copy_of(packet.payload());
    decoder_.emplace(metadata_);
    EXPECT_EQ(decoder_->decode(bytes_, packet_), std::nullopt) << "and holds it to its checksum from now on";
    before_ = ranges_m(packet_);
  }

  static constexpr std::chrono::nanoseconds kTime = 3'000s;
  ouster::Metadata metadata_;
  Bytes bytes_;
  std::optional<ouster::Decoder> decoder_;
  LidarPacket packet_;
  std::vector<float> before_;
};

TEST_P(PacketEditOfOuster, ShiftsTheTimesOfTheValidColumns) {
  shift_clock(bytes_, &metadata_, 60s + 1ns);
  ASSERT_EQ(decoder_->decode(bytes_, packet_), std::nullopt);
  EXPECT_EQ(decoder_->time(), kTime + 60s + 1ns);
  EXPECT_EQ(clock_in(bytes_, &metadata_), decoder_->time() % 1h);
  EXPECT_EQ(ranges_m(packet_), before_);
  const std::byte* const invalid = metadata_.packet_format().column(bytes_.data(), 2);
  EXPECT_EQ(ouster::PacketFormat::time_of(invalid), 0U) << "which has no time";
}

TEST_P(PacketEditOfOuster, LengthensEveryReturnAndNothingElse) {
  const std::vector<FiringGroup> groups{packet_.firing_groups().begin(), packet_.firing_groups().end()};
  lengthen_ranges(bytes_, &metadata_, 2.0);
  ASSERT_EQ(decoder_->decode(bytes_, packet_), std::nullopt);
  const std::vector<float> after = ranges_m(packet_);
  ASSERT_EQ(after.size(), before_.size());
  ASSERT_EQ(after.size(), metadata_.packet_format().profile.echoes);
  for (std::size_t i = 0; i < after.size(); ++i)
    EXPECT_FLOAT_EQ(after[i], before_[i] + 2.0F);
  for (std::size_t i = 0; i < groups.size(); ++i)
    EXPECT_EQ(packet_.firing_groups()[i].intensity, groups[i].intensity);
}

TEST_P(PacketEditOfOuster, KeepsEveryReturnValid) {
  lengthen_ranges(bytes_, &metadata_, -1e6);
  ASSERT_EQ(decoder_->decode(bytes_, packet_), std::nullopt);
  EXPECT_FLOAT_EQ(ranges_m(packet_).front(), 1e-3F * static_cast<float>(1U << decoder_->format().profile.range_shift));
  lengthen_ranges(bytes_, &metadata_, 1e6);
  ASSERT_EQ(decoder_->decode(bytes_, packet_), std::nullopt);
  EXPECT_GT(ranges_m(packet_).front(), 200.0F);
}

TEST_P(PacketEditOfOuster, ANarrowViewLeavesWhatIsAhead) {
  for (std::size_t first = 0; first < metadata_.columns_per_frame; first += 32) {
    test::OusterTestPacket packet{metadata_, first};
    packet.set_return(1, 5, 10'000, 77);
    packet.seal();
    expect_only_ahead(packet.payload(), &metadata_, ouster::Decoder{metadata_});
  }
}

INSTANTIATE_TEST_SUITE_P(Profiles, PacketEditOfOuster, testing::Range(std::size_t{0}, ouster::kProfiles),
                         [](const auto& profile) {
                           return std::string{ouster::spec(static_cast<ouster::Profile>(profile.param)).name};
                         });

TEST(PacketEdit, AChecksumThatWasWrongStaysWrong) {
  const auto metadata = test::ouster_metadata();
  test::OusterTestPacket packet{metadata};
  packet.put(600, 1, 1);
  Bytes bytes = copy_of(packet.payload());
  shift_clock(bytes, &metadata, 1s);
  EXPECT_TRUE(std::ranges::equal(std::span{bytes}.last(8), packet.payload().last(8)));
}

TEST(PacketEdit, ClocksStayAboveZero) {
  const auto metadata = test::ouster_metadata();
  Bytes bytes = copy_of(test::OusterTestPacket{metadata, 0, 1'000}.payload());
  shift_clock(bytes, &metadata, -1h);
  EXPECT_EQ(ouster::PacketFormat::time_of(metadata.packet_format().column(bytes.data(), 0)), 0U);
}

TEST(PacketEdit, ShiftsTheTimeAndReadingsOfAnImu) {
  const auto metadata = test::ouster_metadata();
  Bytes bytes = test::ouster_imu_packet(5'000'000'000, {0, 0, 1}, {1, 2, 3});
  shift_clock(bytes, &metadata, 10s);
  ouster::add_turn(metadata, bytes, 0.5);
  ouster::ImuMeasurements found;
  ASSERT_EQ(ouster::read_imu_packet(metadata, bytes, found), std::nullopt);
  EXPECT_EQ(found.storage[0].time, 15s);
  EXPECT_NEAR(found.storage[0].angular_velocity_radps.z(), 3 * kRadPerDeg + 0.5, 1e-6);
  ouster::make_nan(metadata, bytes);
  EXPECT_TRUE(ouster::read_imu_packet(metadata, bytes, found)) << "not finite";
}

TEST(PacketEdit, ShiftsEveryMeasurementAndTheChecksumOfNewerImus) {
  auto metadata = test::ouster_metadata();
  metadata.standard_imu_packets = true;
  metadata.imu_measurements_per_packet = 2;
  Bytes bytes(ouster::imu_packet_layout(metadata).bytes);
  put_little_endian(bytes.data(), 2, 2);
  for (std::size_t i = 0; i < 2; ++i) {
    put_little_endian(&bytes[132 + 36 * i], 5'000'000'000 + i, 8);
    put_little_endian(&bytes[132 + 36 * i + 10], 1, 2);
  }
  ouster::seal(bytes);
  shift_clock(bytes, &metadata, 10s);
  ouster::add_turn(metadata, bytes, 0.5);
  ouster::ImuMeasurements found;
  ASSERT_EQ(ouster::read_imu_packet(metadata, bytes, found), std::nullopt);
  ASSERT_EQ(found.count, 2U);
  EXPECT_EQ(found.storage[1].time, 15s + 1ns);
  EXPECT_FLOAT_EQ(static_cast<float>(found.storage[1].angular_velocity_radps.z()), 0.5F);
}

/// The packets of all models of Hesai.
class PacketEditOfHesai : public testing::TestWithParam<std::size_t> {
 protected:
  PacketEditOfHesai() : made_(static_cast<hesai::Model>(GetParam()), 0x37) {}

  /// Decodes the original packet; the decoder expects valid checksums from then on.
  void begin() {
    made_.set_return(1, 5, 2'500, 77);
    made_.seal();
    bytes_ = copy_of(made_.payload());
    ASSERT_EQ(decoder_.decode(bytes_, packet_), std::nullopt);
    time_ = decoder_.time();
    ASSERT_EQ(ranges_m(packet_), std::vector{10.0F});
  }
  void expect_shift(Duration shift) {
    shift_clock(bytes_, nullptr, shift);
    ASSERT_EQ(decoder_.decode(bytes_, packet_), std::nullopt);
    EXPECT_EQ(decoder_.time(), time_ + shift);
    const auto clock = clock_in(bytes_, nullptr);
    ASSERT_TRUE(clock);
    EXPECT_LT(std::chrono::abs(clock_advance(*clock, decoder_.time() % 1h)), 10ms) << "up to the first firing";
    EXPECT_EQ(ranges_m(packet_), std::vector{10.0F});
  }

  test::HesaiTestPacket made_;
  Bytes bytes_;
  hesai::Decoder decoder_;
  LidarPacket packet_;
  Duration time_{};
};

TEST_P(PacketEditOfHesai, ShiftsDateAndTime) {
  begin();
  expect_shift(60s + 5us);
}

TEST_P(PacketEditOfHesai, ShiftsOverTheEndOfADayAYearAndACentury) {
  made_.set_time(std::chrono::sys_days{std::chrono::year{2000} / 1 / 1}.time_since_epoch() + 1us, 2000);
  begin();
  expect_shift(-2us);
}

TEST_P(PacketEditOfHesai, ShiftsADateThatCountsSeconds) {
  made_.set_microseconds(999'999);
  for (const auto& [at, value] : {std::pair{0, 0}, {1, 0}, {2, 0x65}, {3, 0xFF}, {4, 0xFF}, {5, 0xFF}})
    made_.set_date_byte(static_cast<std::size_t>(at), static_cast<std::uint8_t>(value));
  begin();
  expect_shift(1us);
}

TEST_P(PacketEditOfHesai, LengthensEveryReturnAndNothingElse) {
  begin();
  lengthen_ranges(bytes_, nullptr, -2.0);
  ASSERT_EQ(decoder_.decode(bytes_, packet_), std::nullopt);
  EXPECT_EQ(ranges_m(packet_), std::vector{8.0F});
  EXPECT_EQ(decoder_.time(), time_);
}

TEST_P(PacketEditOfHesai, ANarrowViewLeavesWhatIsAhead) {
  for (int azimuth_cdeg = 0; azimuth_cdeg < 36'000; azimuth_cdeg += 1'000) {
    test::HesaiTestPacket packet{static_cast<hesai::Model>(GetParam()), 0x37, test::HesaiTestPacket::kTime,
                                 static_cast<std::uint16_t>(azimuth_cdeg)};
    packet.set_return(1, 5, 2'500, 77);
    packet.seal();
    expect_only_ahead(packet.payload(), nullptr, hesai::Decoder{});
  }
}

INSTANTIATE_TEST_SUITE_P(Models, PacketEditOfHesai, testing::Range(std::size_t{0}, hesai::kModels),
                         [](const auto& model) {
                           return std::string{to_string(static_cast<hesai::Model>(model.param))};
                         });

TEST(PacketEdit, InvalidVelodyneTimeIsUnchanged) {
  Bytes bytes(velodyne::kDataPacketBytes);
  put_little_endian(&bytes[velodyne::kTimeOffset], 3'600'000'000, 4);
  shift_clock(bytes, nullptr, 1s);
  EXPECT_EQ(read_u32(&bytes[velodyne::kTimeOffset]), 3'600'000'000);
  put_little_endian(&bytes[velodyne::kTimeOffset], 3'599'000'000, 4);
  shift_clock(bytes, nullptr, 1h + 1s);
  EXPECT_EQ(read_u32(&bytes[velodyne::kTimeOffset]), 0U);
}

TEST(PacketClock, IsReadModuloAnHourFromDataPacketsAlone) {
  test::VelodyneTestPacket packet{velodyne::Model::vlp16, velodyne::ReturnMode::strongest, 0, 0};
  Bytes bytes = copy_of(packet.payload());
  put_little_endian(&bytes[velodyne::kTimeOffset], 3'600'000'007, 4);
  EXPECT_EQ(clock_in(bytes, nullptr), 7us);
  EXPECT_FALSE(clock_in(Bytes(velodyne::kPositionPacketBytes), nullptr));
  EXPECT_FALSE(clock_in(Bytes(velodyne::kDataPacketBytes), nullptr));
  EXPECT_FALSE(clock_in(Bytes{}, nullptr));
  const auto metadata = test::ouster_metadata();
  EXPECT_FALSE(clock_in(bytes, &metadata));
  EXPECT_EQ(clock_advance(3599s, 1s), 2s);
  EXPECT_EQ(clock_advance(1s, 3599s), -2s);
  EXPECT_EQ(clock_advance(5s, 5s), 0s);
}

TEST(PacketEdit, NarrowViewOfAVelodyneLeavesWhatIsAhead) {
  for (const velodyne::Model model : velodyne::kModels) {
    for (int azimuth_cdeg = 0; azimuth_cdeg < 36'000; azimuth_cdeg += 1'000) {
      test::VelodyneTestPacket packet{model, velodyne::ReturnMode::strongest, 0,
                                      static_cast<std::uint16_t>(azimuth_cdeg)};
      packet.set_return(4, 5, 5'000);
      expect_only_ahead(packet.payload(), nullptr, velodyne::Decoder{});
    }
  }
}

TEST(PacketEdit, OtherDatagramsAreUnchanged) {
  const auto metadata = test::ouster_metadata();
  for (const std::size_t size : {0U, 1U, 100U, 1080U}) {
    Bytes bytes(size, std::byte{0xEE});
    for (const ouster::Metadata* ouster : {static_cast<const ouster::Metadata*>(nullptr), &metadata}) {
      shift_clock(bytes, ouster, 1s);
      lengthen_ranges(bytes, ouster, 1.0);
      narrow_view(bytes, ouster, 90);
    }
    EXPECT_EQ(bytes, Bytes(size, std::byte{0xEE}));
  }
}

} // namespace
} // namespace locus

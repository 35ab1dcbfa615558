// SPDX-License-Identifier: Apache-2.0
#include "drivers/ouster/imu_packet.hpp"

#include <algorithm>
#include <limits>

#include <gtest/gtest.h>

#include "drivers/ouster_test_packet.hpp"

namespace locus::ouster {
namespace {

using test::ouster_imu_packet;
using test::ouster_metadata;

constexpr std::uint64_t kTimeNs = 991'609'118'790;

Metadata standard_metadata() {
  Metadata metadata = ouster_metadata();
  metadata.standard_imu_packets = true;
  metadata.imu_measurements_per_packet = 8;
  return metadata;
}

/// Returns a packet of newer firmware: eight measurements 1.5 ms apart, with rates of 0.1, 0.2, ... rad/s.
std::vector<std::byte> standard_packet(const Metadata& metadata) {
  std::vector<std::byte> bytes(452);
  test::put_little_endian(&bytes[0], 2, 2);
  test::put_little_endian(&bytes[4], metadata.init_id, 3);
  test::put_little_endian(&bytes[7], metadata.serial_number, 5);
  for (std::size_t i = 0; i < 8; ++i) {
    std::byte* const at = &bytes[132 + 36 * i];
    test::put_little_endian(at, kTimeNs + i * 1'500'000, 8);
    test::put_little_endian(at + 10, 1, 2);
    test::put_little_endian(at + 20, std::bit_cast<std::uint32_t>(9.81F), 4);
    test::put_little_endian(at + 24, std::bit_cast<std::uint32_t>(0.1F * static_cast<float>(i + 1)), 4);
  }
  return bytes;
}

void seal(std::vector<std::byte>& bytes) {
  test::put_little_endian(&bytes[bytes.size() - 8], crc64(std::span{bytes}.first(bytes.size() - 8)), 8);
}

TEST(OusterImuPacket, IsReadInSiUnits) {
  ImuMeasurements measurements;
  const auto bytes = ouster_imu_packet(kTimeNs, {0.5F, 0.0F, 1.0F}, {0.0F, -90.0F, 180.0F});
  ASSERT_EQ(read_imu_packet(ouster_metadata(), bytes, measurements), std::nullopt);
  ASSERT_EQ(measurements.count, 1U);
  const ImuMeasurement& only = measurements.all()[0];
  EXPECT_EQ(only.time.count(), static_cast<std::int64_t>(kTimeNs));
  EXPECT_TRUE(only.specific_force_mps2.isApprox(Eigen::Vector3d{4.903325, 0.0, 9.80665}, 1e-9));
  EXPECT_TRUE(only.angular_velocity_radps.isApprox(Eigen::Vector3d{0.0, -90.0 * kRadPerDeg, 180.0 * kRadPerDeg}, 1e-9));
}

TEST(OusterImuPacket, IsTimedByItsGyro) {
  auto bytes = ouster_imu_packet(kTimeNs, {0.0F, 0.0F, 1.0F}, {0.0F, 0.0F, 0.0F});
  test::put_little_endian(&bytes[16], kTimeNs + 222'000, 8);
  ImuMeasurements measurements;
  ASSERT_EQ(read_imu_packet(ouster_metadata(), bytes, measurements), std::nullopt);
  EXPECT_EQ(measurements.all()[0].time.count(), static_cast<std::int64_t>(kTimeNs + 222'000));
}

TEST(OusterImuPacket, RejectsAbsurdValues) {
  const Metadata metadata = ouster_metadata();
  ImuMeasurements measurements;
  for (const std::size_t length : {0U, 1U, 47U, 49U, 452U})
    EXPECT_EQ(read_imu_packet(metadata, std::vector<std::byte>(length), measurements), PacketError::length) << length;
  for (const float absurd : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    EXPECT_EQ(read_imu_packet(metadata, ouster_imu_packet(kTimeNs, {0, absurd, 1}, {0, 0, 0}), measurements),
              PacketError::flag);
    EXPECT_EQ(read_imu_packet(metadata, ouster_imu_packet(kTimeNs, {0, 0, 1}, {absurd, 0, 0}), measurements),
              PacketError::flag);
  }
  EXPECT_EQ(read_imu_packet(metadata, ouster_imu_packet(~std::uint64_t{0}, {0, 0, 1}, {0, 0, 0}), measurements),
            PacketError::time);
}

TEST(OusterImuPacket, OfNewerFirmwareHoldsSeveralMeasurements) {
  const Metadata metadata = standard_metadata();
  ImuMeasurements measurements;
  auto bytes = standard_packet(metadata);
  seal(bytes);
  ASSERT_EQ(read_imu_packet(metadata, bytes, measurements), std::nullopt);
  ASSERT_EQ(measurements.count, 8U);
  EXPECT_EQ(measurements.all()[7].time.count(), static_cast<std::int64_t>(kTimeNs + 7 * 1'500'000));
  EXPECT_NEAR(measurements.all()[7].angular_velocity_radps.x(), 0.8, 1e-6);
  EXPECT_NEAR(measurements.all()[7].specific_force_mps2.z(), 9.81, 1e-6);

  test::put_little_endian(&bytes[132 + 36 * 3 + 10], 0, 2);
  seal(bytes);
  ASSERT_EQ(read_imu_packet(metadata, bytes, measurements), std::nullopt);
  EXPECT_EQ(measurements.count, 7U) << "one is invalid";
}

TEST(OusterImuPacket, OfNewerFirmwareIsRejectedForABadHeaderOrFooter) {
  const Metadata metadata = standard_metadata();
  const auto error_of = [&](std::size_t at, std::uint64_t value, std::size_t count, bool sealed = true) {
    auto bytes = standard_packet(metadata);
    test::put_little_endian(&bytes[at], value, count);
    if (sealed)
      seal(bytes);
    ImuMeasurements measurements;
    return read_imu_packet(metadata, bytes, measurements);
  };
  EXPECT_EQ(error_of(0, 3, 2), PacketError::flag);
  EXPECT_EQ(error_of(7, 1, 5), PacketError::sender);
  EXPECT_EQ(error_of(140, 1, 1, false), PacketError::checksum);
  EXPECT_EQ(error_of(132, ~std::uint64_t{0}, 8), PacketError::time);
}

/// The header has other offsets, and no checksum ends the packet.
TEST(OusterImuPacket, OfFunctionalSafetyIsReadByItsOwnHeader) {
  Metadata metadata = standard_metadata();
  metadata.safety_header = true;
  auto bytes = standard_packet(metadata);
  std::fill_n(bytes.begin(), 32, std::byte{});
  test::put_little_endian(&bytes[0], 2, 1);
  test::put_little_endian(&bytes[1], metadata.init_id, 3);
  test::put_little_endian(&bytes[4], 70'000, 4);
  test::put_little_endian(&bytes[11], metadata.serial_number, 5);
  ImuMeasurements measurements;
  EXPECT_EQ(read_imu_packet(metadata, bytes, measurements), std::nullopt);
  EXPECT_EQ(measurements.count, 8U);
  EXPECT_TRUE(is_standard_imu_packet(bytes));
  test::put_little_endian(&bytes[11], 1, 5);
  EXPECT_EQ(read_imu_packet(metadata, bytes, measurements), PacketError::sender);
}

TEST(OusterImuPacket, OfNewerFirmwareIsKnownByItsHeaderAndItsLength) {
  const auto bytes = standard_packet(standard_metadata());
  EXPECT_TRUE(is_standard_imu_packet(bytes));
  EXPECT_FALSE(is_standard_imu_packet(std::span{bytes}.first(451)));
  EXPECT_FALSE(is_standard_imu_packet({}));
  auto column_packet = bytes;
  test::put_little_endian(&column_packet[0], 1, 2);
  EXPECT_FALSE(is_standard_imu_packet(column_packet));
}

} // namespace
} // namespace locus::ouster

// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "core/base/pose.hpp"
#include "drivers/velodyne/decoder.hpp"
#include "drivers/velodyne_test_packet.hpp"
#include "support/returns.hpp"

namespace locus::velodyne {
namespace {

using test::VelodyneTestPacket;

constexpr std::array kModes{ReturnMode::strongest, ReturnMode::last, ReturnMode::dual};
constexpr double kRadPerCdeg = std::numbers::pi / 18000.0;

LidarPacket decoded(const VelodyneTestPacket& bytes, const DecoderOptions& options = {}) {
  Decoder decoder{options};
  LidarPacket packet;
  EXPECT_EQ(decoder.decode(bytes.payload(), packet), std::nullopt);
  return packet;
}

std::vector<LidarReturn> returns_in(const VelodyneTestPacket& bytes, const DecoderOptions& options = {}) {
  return test::returns_of(decoded(bytes, options));
}

double clockwise_azimuth_rad(const LidarReturn& r) {
  return std::atan2(-static_cast<double>(r.y_m), static_cast<double>(r.x_m));
}

double angle_between(double a_rad, double b_rad) {
  return std::abs(std::remainder(a_rad - b_rad, 2.0 * std::numbers::pi));
}

TEST(VelodyneDecoder, EveryFiringHasItsTimeDirectionAndRing) {
  constexpr std::uint16_t kDistance = 5000;
  for (const Model model : kModels) {
    for (const ReturnMode mode : kModes) {
      VelodyneTestPacket bytes{model, mode, 1'000'000, 12'345};
      bytes.set_all_returns(kDistance);
      const LidarPacket packet = decoded(bytes, {.model = model});

      const ModelSpec& figures = spec(model);
      const PacketLayout layout = packet_layout(model, mode);
      const auto firings = figures.firings();
      const std::vector<LidarReturn> returns = test::returns_of(packet);
      ASSERT_EQ(returns.size(), layout.columns * firings.size()) << to_string(model) << ' ' << to_string(mode);
      EXPECT_EQ(packet.duration, packet_duration(model, mode));
      const double turn_cdeg = layout.columns > 1 ? 10.0 * kCdegPerTurn * to_seconds(figures.column_duration) : 0.0;
      for (std::size_t n = 0; n < returns.size(); ++n) {
        const std::size_t column = n / firings.size();
        const Firing& firing = firings[n % firings.size()];
        const Laser& laser = figures.calibration.storage[firing.laser];
        const LidarReturn& r = returns[n];
        const auto expected_ns = static_cast<std::int64_t>(column) * figures.column_duration.count() + firing.offset_ns;
        ASSERT_EQ(r.offset_ns, expected_ns) << to_string(model) << ' ' << to_string(mode) << " return " << n;
        ASSERT_EQ(r.ring, laser.ring);
        const double range_m = kDistance * figures.calibration.distance_resolution_m;
        ASSERT_NEAR(static_cast<double>(r.range_m), range_m, 1e-5);
        ASSERT_NEAR(static_cast<double>(r.z_m), range_m * std::sin(laser.elevation_rad) + laser.vertical_offset_m,
                    1e-5);
        ASSERT_NEAR(std::hypot(static_cast<double>(r.x_m), static_cast<double>(r.y_m)),
                    range_m * std::cos(laser.elevation_rad), 1e-5);
        const double share = static_cast<double>(expected_ns) / static_cast<double>(figures.column_duration.count());
        const double azimuth_cdeg = 12'345.0 + turn_cdeg * share;
        ASSERT_LT(angle_between(clockwise_azimuth_rad(r), azimuth_cdeg * kRadPerCdeg + laser.azimuth_offset_rad),
                  0.6 * kRadPerCdeg);
      }
    }
  }
}

TEST(VelodyneDecoder, AxesAreForwardLeftUp) {
  VelodyneTestPacket bytes{Model::vlp16, ReturnMode::strongest, 0, 9'000, 0.0}; // rotor at rest, facing right
  bytes.set_return(0, 15, 5000);                                                // the laser at +15 degrees
  const std::vector<LidarReturn> returns = returns_in(bytes);
  ASSERT_EQ(returns.size(), 1U);
  EXPECT_NEAR(returns[0].x_m, 0.0, 1e-5);
  EXPECT_NEAR(returns[0].y_m, -10.0 * std::cos(15.0 * kRadPerDeg), 1e-5);
  EXPECT_NEAR(returns[0].z_m, 10.0 * std::sin(15.0 * kRadPerDeg) - 0.0112, 1e-5);
}

TEST(VelodyneDecoder, AzimuthIsInterpolatedAtAnySpeedAndThroughTheWrap) {
  for (double rpm = 300.0; rpm <= 1200.0; rpm += 60.0) {
    for (std::uint16_t start_cdeg = 0; start_cdeg < kCdegPerTurn;
         start_cdeg = static_cast<std::uint16_t>(start_cdeg + 617)) {
      VelodyneTestPacket bytes{Model::hdl32e, ReturnMode::strongest, 0, start_cdeg, rpm};
      bytes.set_all_returns(1000);
      const std::vector<LidarReturn> returns = returns_in(bytes, {.model = Model::hdl32e});
      ASSERT_EQ(returns.size(), 384U);
      for (const LidarReturn& r : returns) {
        const double expected_cdeg = start_cdeg + rpm / 60.0 * kCdegPerTurn * 1e-9 * r.offset_ns;
        ASSERT_LT(angle_between(clockwise_azimuth_rad(r), expected_cdeg * kRadPerCdeg), 0.6 * kRadPerCdeg)
            << rpm << " rpm from " << start_cdeg;
      }
    }
  }
}

TEST(VelodyneDecoder, TimeOfHourIsThatOfTheFirstFiring) {
  constexpr Duration kHour = std::chrono::hours{1};
  for (const Model model : kModels) {
    const Duration delay = spec(model).stamp_delay;
    Decoder decoder({.model = model});
    LidarPacket packet;
    for (const std::uint32_t stamp_us : {0U, 1'000'000U}) {
      ASSERT_EQ(decoder.decode(VelodyneTestPacket(model, ReturnMode::strongest, stamp_us).payload(), packet),
                std::nullopt);
      EXPECT_EQ(decoder.time_of_hour(), (kHour + std::chrono::microseconds{stamp_us} - delay) % kHour);
    }
  }
}

TEST(VelodyneDecoder, RotationRateFollowsTheColumns) {
  Decoder decoder;
  LidarPacket packet;
  EXPECT_EQ(decoder.rotation_rate_rpm(), 0.0);
  ASSERT_EQ(decoder.decode(VelodyneTestPacket(Model::vlp16, ReturnMode::dual, 0, 0, 1200.0).payload(), packet),
            std::nullopt);
  EXPECT_NEAR(decoder.rotation_rate_rpm(), 1200.0, 4.0);
}

TEST(VelodyneDecoder, Vls128InDualModeUsesTheRateOfThePreviousPacket) {
  Decoder decoder;
  LidarPacket packet;
  VelodyneTestPacket first{Model::vls128, ReturnMode::dual, 1'000'000, 100};
  VelodyneTestPacket second{Model::vls128, ReturnMode::dual, 1'001'066, 484}; // 20 packets later, at 600 rpm
  second.set_all_returns(1000);
  ASSERT_EQ(decoder.decode(first.payload(), packet), std::nullopt);
  ASSERT_EQ(decoder.decode(second.payload(), packet), std::nullopt);
  EXPECT_NEAR(decoder.rotation_rate_rpm(), 600.0, 1.0);
  const Laser& last_laser = spec(Model::vls128).calibration.storage[kMaxLasers - 1];
  EXPECT_LT(angle_between(clockwise_azimuth_rad(test::returns_of(packet).back()),
                          (484 + 19.2 * 16 / 20) * kRadPerCdeg + last_laser.azimuth_offset_rad),
            1.0 * kRadPerCdeg)
      << "16 of 20 slots of a turn of 19.2";
}

TEST(VelodyneDecoder, EqualSecondReturnIsEmittedOnce) {
  VelodyneTestPacket bytes{Model::vlp16, ReturnMode::dual};
  bytes.set_return(2, 3, 1000, 7); // both echoes equal
  bytes.set_return(3, 3, 1000, 7);
  bytes.set_return(4, 5, 2000, 8); // last and strongest differ
  bytes.set_return(5, 5, 1500, 9);
  bytes.set_return(6, 6, 3000, 1); // only one of them
  bytes.set_return(9, 7, 3500, 2);
  const std::vector<LidarReturn> returns = returns_in(bytes);
  ASSERT_EQ(returns.size(), 5U);
  std::vector<int> intensities;
  for (const LidarReturn& r : returns)
    intensities.push_back(r.intensity);
  EXPECT_EQ(intensities, (std::vector{7, 8, 9, 1, 2}))
      << "in the order of firing, the last return before the strongest";
  EXPECT_EQ(returns[1].offset_ns, returns[2].offset_ns);
}

TEST(VelodyneDecoder, DistanceZeroIsNoReturn) {
  EXPECT_TRUE(returns_in({Model::vls128, ReturnMode::strongest}).empty());
}

TEST(VelodyneDecoder, ColumnsBehindABlindSectorAreLaterByItsLength) {
  // A VLP-32C with a field of view from 270 to 90 degrees: the packet continues after the blind sector.
  VelodyneTestPacket bytes{Model::vlp32c, ReturnMode::strongest, 0, 9'000, 600.0};
  for (std::size_t block = 8; block < kBlocks; ++block)
    bytes.set_azimuth(block, static_cast<std::uint16_t>(27'000 + 20 * (block - 8)));
  bytes.set_all_returns(1000);
  const LidarPacket packet = decoded(bytes);
  const std::vector<LidarReturn> returns = test::returns_of(packet);
  ASSERT_EQ(returns.size(), 384U);
  const double seconds_per_cdeg = 0.1 / kCdegPerTurn;
  EXPECT_NEAR(1e-9 * returns[8 * kChannels].offset_ns, (27'000 - 9'000) * seconds_per_cdeg, 1e-4);
  const Laser& last_laser = spec(Model::vlp32c).calibration.storage[kChannels - 1];
  EXPECT_LT(angle_between(clockwise_azimuth_rad(returns[8 * kChannels - 1]),
                          9'156 * kRadPerCdeg + last_laser.azimuth_offset_rad),
            10 * kRadPerCdeg)
      << "interpolated as if the sector were not there";
  EXPECT_NEAR(to_seconds(packet.duration), (27'080 - 9'000) * seconds_per_cdeg, 1e-4);
}

/// Regression: encoder jitter was interpreted as a blind sector that takes twenty seconds at this speed.
TEST(VelodyneDecoder, StoppedMotorHasNoBlindSector) {
  VelodyneTestPacket bytes{Model::vlp16, ReturnMode::strongest, 0, 100, 0.0};
  bytes.set_azimuth(7, 101);
  bytes.set_all_returns(1000);
  EXPECT_EQ(decoded(bytes).duration, packet_duration(Model::vlp16, ReturnMode::strongest));
}

TEST(VelodyneDecoder, AnyOtherLengthIsRejected) {
  Decoder decoder;
  LidarPacket packet;
  const std::vector<std::byte> bytes(1500, std::byte{0xFF});
  for (std::size_t length = 0; length <= bytes.size(); ++length) {
    const auto error = decoder.decode(std::span{bytes}.first(length), packet);
    EXPECT_EQ(error, length == kDataPacketBytes ? PacketError::model : PacketError::length) << length;
  }
}

TEST(VelodyneDecoder, WrongFlagIsRejected) {
  LidarPacket packet;
  for (std::size_t block = 0; block < kBlocks; ++block) {
    VelodyneTestPacket bytes{Model::vls128, ReturnMode::strongest};
    bytes.set_flag(block, 0xEEFE);
    EXPECT_EQ(Decoder{}.decode(bytes.payload(), packet), PacketError::flag);
  }
}

/// Packet number `i` of a VLS-128 at 600 rpm, its stamp in whole microseconds.
VelodyneTestPacket vls128_packet(ReturnMode mode, Pace pace, int i) {
  const double us = 1e6 * to_seconds(packet_duration(Model::vls128, mode, pace)) * i;
  return {Model::vls128, mode, static_cast<std::uint32_t>(1e6 + us), static_cast<std::uint16_t>(std::lround(0.36 * us)),
          600.0,         pace};
}

TEST(VelodyneDecoder, Vls128IsReadAtThePaceOfItsPackets) {
  for (const Pace pace : {Pace::first, Pace::slower}) {
    for (const ReturnMode mode : {ReturnMode::strongest, ReturnMode::dual}) {
      Decoder decoder;
      LidarPacket packet;
      for (int i = 0; i < 10; ++i)
        EXPECT_FALSE(decoder.decode(vls128_packet(mode, pace, i).payload(), packet));
      EXPECT_EQ(decoder.pace(), pace);
      EXPECT_EQ(decoder.recognised_model(), Model::vls128);
      EXPECT_EQ(packet.duration, packet_duration(Model::vls128, mode, pace));
      EXPECT_NEAR(decoder.rotation_rate_rpm(), 600.0, 15.0) << "of azimuths in whole hundredths of a degree";
    }
  }
}

/// Four of its packets take as long as one of a VLP-32C.
TEST(VelodyneDecoder, SlowVls128ThatLosesThreePacketsIsNoVlp32c) {
  Decoder decoder;
  LidarPacket packet;
  for (const int i : {0, 1, 2, 3, 7, 8, 12})
    EXPECT_FALSE(decoder.decode(vls128_packet(ReturnMode::strongest, Pace::slower, i).payload(), packet)) << i;
  EXPECT_EQ(decoder.model(), Model::vls128);
  EXPECT_EQ(decoder.pace(), Pace::slower);
}

TEST(VelodyneDecoder, PacketsOfUnknownModelsAreCountedByTheirMostFrequentProductId) {
  Decoder decoder;
  LidarPacket packet;
  EXPECT_FALSE(decoder.unknown_packets());
  for (const int product_id : {0x31, 0x63, 0x31}) {
    VelodyneTestPacket bytes{Model::vlp16, ReturnMode::strongest};
    bytes.set_product_id(static_cast<std::uint8_t>(product_id));
    EXPECT_EQ(decoder.decode(bytes.payload(), packet), PacketError::model);
  }
  ASSERT_TRUE(decoder.unknown_packets());
  EXPECT_EQ(to_string(*decoder.unknown_packets()), "product id 0x31 and return mode 0x37 in 2 packets");
}

TEST(VelodyneDecoder, UnusedBlocksOfTheVls128MayHoldAnything) {
  VelodyneTestPacket bytes{Model::vls128, ReturnMode::dual};
  for (std::size_t block = 8; block < kBlocks; ++block)
    bytes.set_azimuth(block, 65'535);
  decoded(bytes);
}

TEST(VelodyneDecoder, AbsurdAzimuthsAreRejected) {
  LidarPacket packet;
  VelodyneTestPacket beyond{Model::vlp16, ReturnMode::strongest};
  beyond.set_azimuth(7, 36'001);
  EXPECT_EQ(Decoder{}.decode(beyond.payload(), packet), PacketError::azimuth);

  VelodyneTestPacket backwards{Model::vlp16, ReturnMode::strongest};
  for (std::size_t block = 0; block < kBlocks; ++block)
    backwards.set_azimuth(block, static_cast<std::uint16_t>(20'000 - 40 * block));
  EXPECT_EQ(Decoder{}.decode(backwards.payload(), packet), PacketError::azimuth);
}

TEST(VelodyneDecoder, FullTurnIsZero) {
  // HDL-32E and VLP-16 occasionally report 360.00 degrees.
  VelodyneTestPacket bytes{Model::hdl32e, ReturnMode::strongest, 0, 35'924, 704.0};
  bytes.set_azimuth(4, 36'000);
  bytes.set_all_returns(1000);
  const std::vector<LidarReturn> returns = returns_in(bytes, {.model = Model::hdl32e});
  EXPECT_LT(angle_between(clockwise_azimuth_rad(returns[4 * kChannels]), 0.0), 0.6 * kRadPerCdeg);
}

/// Some lidars go on counting beyond the hour; every packet of theirs was refused from then on.
TEST(VelodyneDecoder, TimeBeyondTheHourWraps) {
  LidarPacket packet;
  Decoder decoder;
  for (const std::uint32_t us : {3'600'000'000U, 4'294'967'295U}) {
    ASSERT_EQ(decoder.decode(VelodyneTestPacket(Model::vlp16, ReturnMode::strongest, us).payload(), packet),
              std::nullopt);
    EXPECT_EQ(decoder.time_of_hour(), std::chrono::microseconds{us} % std::chrono::hours{1});
  }
}

TEST(VelodyneDecoder, UnknownFactoryBytesAreRejectedUnlessConfigured) {
  LidarPacket packet;
  VelodyneTestPacket bytes{Model::vlp16, ReturnMode::strongest};
  bytes.set_product_id(0x77);
  EXPECT_EQ(Decoder{}.decode(bytes.payload(), packet), PacketError::model);
  EXPECT_EQ(Decoder{{.model = Model::vlp16}}.decode(bytes.payload(), packet), std::nullopt);
  bytes.set_return_mode(0x00);
  EXPECT_EQ(Decoder{{.model = Model::vlp16}}.decode(bytes.payload(), packet), PacketError::model);
  Decoder told{{.model = Model::vlp16, .return_mode = ReturnMode::last}};
  EXPECT_EQ(told.decode(bytes.payload(), packet), std::nullopt);
  EXPECT_EQ(told.return_mode(), ReturnMode::last);
}

TEST(VelodyneDecoder, CalibrationForAnotherNumberOfLasersIsRejected) {
  LidarPacket packet;
  Decoder decoder{{.calibration = spec(Model::vlp16).calibration}};
  EXPECT_EQ(decoder.decode(VelodyneTestPacket(Model::hdl32e, ReturnMode::strongest).payload(), packet),
            PacketError::model);
  EXPECT_EQ(decoder.decode(VelodyneTestPacket(Model::vlp16, ReturnMode::strongest).payload(), packet), std::nullopt);
}

TEST(VelodyneDecoder, CalibratedOffsetsMoveTheReturn) {
  Calibration calibration = spec(Model::vlp16).calibration;
  calibration.storage[15] = {.elevation_rad = 0.0,
                             .azimuth_offset_rad = 0.1,
                             .vertical_offset_m = 0.3,
                             .radial_offset_m = 0.2,
                             .lateral_offset_m = 0.05,
                             .range_offset_m = 1.0};
  VelodyneTestPacket bytes{Model::vlp16, ReturnMode::strongest, 0, 0, 0.0};
  bytes.set_return(0, 15, 5000);
  const std::vector<LidarReturn> returns = returns_in(bytes, {.calibration = calibration});
  ASSERT_EQ(returns.size(), 1U);
  EXPECT_NEAR(returns[0].range_m, 11.0, 1e-5);
  EXPECT_NEAR(returns[0].x_m, 11.2 * std::cos(0.1) + 0.05 * std::sin(0.1), 1e-5);
  EXPECT_NEAR(returns[0].y_m, -11.2 * std::sin(0.1) + 0.05 * std::cos(0.1), 1e-5);
  EXPECT_NEAR(returns[0].z_m, 0.3, 1e-5);
}

TEST(VelodyneDecoder, PacketSpacingOverrulesTheProductId) {
  LidarPacket packet;
  for (const ReturnMode mode : kModes) {
    for (const Model truth : {Model::vlp16, Model::vlp32c, Model::hdl32e, Model::vls128}) {
      for (const Model claim : {Model::vlp16, Model::vlp32c, Model::hdl32e, Model::vls128}) {
        if ((claim == Model::vls128) != (truth == Model::vls128))
          continue; // has its own flags: undecodable by another model's id until the spacing is known
        if (claim == Model::vlp32c && truth == Model::vlp16)
          continue; // exactly twice the spacing: indistinguishable from the loss of every second packet
        Decoder decoder;
        const double spacing_us = 1e6 * to_seconds(packet_duration(truth, mode));
        for (const int number : {0, 1, 2, 5, 6}) { // two are lost
          VelodyneTestPacket bytes{truth, mode, static_cast<std::uint32_t>(1e6 + spacing_us * number)};
          bytes.set_product_id(spec(claim).product_id);
          ASSERT_EQ(decoder.decode(bytes.payload(), packet), std::nullopt);
          if (number > 0) {
            ASSERT_EQ(decoder.model(), truth)
                << to_string(claim) << " is a " << to_string(truth) << ' ' << to_string(mode);
          }
        }
      }
    }
  }
}

TEST(VelodyneDecoder, ConfiguredModelIsUsedAndTheReportedOneNamed) {
  Decoder decoder{{.model = Model::vlp16}};
  LidarPacket packet;
  EXPECT_EQ(decoder.recognised_model(), std::nullopt);
  for (const std::uint32_t number : {0U, 1U, 2U}) {
    VelodyneTestPacket bytes(Model::hdl32e, ReturnMode::strongest, 553 * number);
    ASSERT_EQ(decoder.decode(bytes.payload(), packet), std::nullopt);
    EXPECT_EQ(decoder.model(), Model::vlp16);
  }
  EXPECT_EQ(decoder.recognised_model(), Model::hdl32e);
  EXPECT_EQ(decoder.decode(VelodyneTestPacket(Model::vls128, ReturnMode::strongest, 2'000).payload(), packet),
            PacketError::flag);
  EXPECT_EQ(decoder.recognised_model(), Model::vls128) << "of a packet that is refused, too";
}

TEST(VelodyneDecoder, PuckHiResIsDistinguishedFromAVlp16) {
  Decoder decoder;
  LidarPacket packet;
  for (const std::uint32_t number : {0U, 1U, 2U}) {
    ASSERT_EQ(
        decoder.decode(VelodyneTestPacket(Model::puck_hi_res, ReturnMode::strongest, 1'327 * number).payload(), packet),
        std::nullopt);
    EXPECT_EQ(decoder.model(), Model::puck_hi_res);
  }
}

TEST(VelodyneDecoder, AnyBytesAreSurvived) {
  std::mt19937 random{7};
  std::uniform_int_distribution<int> byte{0, 255};
  std::uniform_int_distribution<std::size_t> at{0, kDataPacketBytes - 1};
  Decoder decoder;
  LidarPacket packet;
  int decoded_packets = 0;
  for (int i = 0; i < 20'000; ++i) {
    VelodyneTestPacket good{kModels[static_cast<std::size_t>(i) % kModels.size()],
                            kModes[static_cast<std::size_t>(i) % 3]};
    good.set_all_returns(static_cast<std::uint16_t>(i));
    std::vector<std::byte> bytes{good.payload().begin(), good.payload().end()};
    for (int flips = i % 8; flips > 0; --flips)
      bytes[at(random)] = static_cast<std::byte>(byte(random));
    if (i % 10 == 0)
      std::generate(bytes.begin(), bytes.end(), [&] { return static_cast<std::byte>(byte(random)); });
    if (decoder.decode(bytes, packet))
      continue;
    ++decoded_packets;
    ASSERT_LE(packet.count, LidarPacket::kMaxFiringGroups);
    for (const LidarReturn& r : test::returns_of(packet)) {
      ASSERT_TRUE(std::isfinite(r.x_m) && std::isfinite(r.y_m) && std::isfinite(r.z_m));
      ASSERT_GT(r.range_m, 0.0F);
      ASSERT_LT(r.ring, kMaxLasers);
    }
  }
  EXPECT_GT(decoded_packets, 1000) << "or this test tries nothing";
}

} // namespace
} // namespace locus::velodyne

// SPDX-License-Identifier: Apache-2.0
#include "drivers/hesai/decoder.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <optional>
#include <random>
#include <vector>

#include "drivers/hesai_test_packet.hpp"
#include "support/returns.hpp"

namespace locus::hesai {
namespace {

using std::chrono::microseconds;
using std::chrono::nanoseconds;
using std::chrono::seconds;
using test::HesaiTestPacket;

constexpr std::uint8_t kStrongest = 0x37, kDual = 0x39, kTriple = 0x3D;
constexpr std::uint16_t kTenMetres = 2500; // in units of 4 mm

std::vector<Model> all_models() {
  std::vector<Model> models;
  for (std::size_t i = 0; i < kModels; ++i)
    models.push_back(static_cast<Model>(i));
  return models;
}

/// Decodes a packet and returns its only return.
LidarReturn only_return(Decoder& decoder, const HesaiTestPacket& bytes) {
  LidarPacket packet;
  EXPECT_EQ(decoder.decode(bytes.payload(), packet), std::nullopt);
  const std::vector<LidarReturn> returns = test::returns_of(packet);
  EXPECT_EQ(returns.size(), 1U);
  return returns.empty() ? LidarReturn{} : returns.front();
}

class HesaiModel : public testing::TestWithParam<Model> {};

/// Direction by the manual: azimuth of the block, the laser's own offset, and the rotation until it fires.
TEST_P(HesaiModel, EachReturnHasDirectionAndTimeOfItsOwnFiring) {
  const Model model = GetParam();
  const ModelSpec& its = spec(model);
  constexpr std::uint16_t kAzimuthCdeg = 12'345;
  const bool takes_turns = its.sequence_from == SequenceFrom::mode_flag; // blocks of two sequences
  for (std::size_t channel = 0; channel < its.layout.channels; ++channel) {
    const std::size_t last_block = takes_turns && channel / 32 == 1 ? 0 : its.layout.blocks - 1;
    const std::size_t sequence = takes_turns ? last_block : 0;
    const FiringSequence& firings = its.sequences[sequence];
    HesaiTestPacket bytes{model, kStrongest, HesaiTestPacket::kTime, kAzimuthCdeg};
    bytes.set_return(last_block, channel, kTenMetres, 77);
    bytes.seal();
    Decoder decoder;
    const LidarReturn found = only_return(decoder, bytes);
    EXPECT_EQ(decoder.model(), model);
    const double turn_cdeg = 600.0 * 600.0 * to_seconds(firings.column_duration);
    const double block_cdeg = kAzimuthCdeg + std::round(turn_cdeg * static_cast<double>(last_block));
    const double rad_per_ns = 2.0 * std::numbers::pi * 10.0 * 1e-9;
    const Laser& laser = its.calibration.storage[channel];
    const double azimuth_rad =
        block_cdeg * std::numbers::pi / 18000.0 + laser.azimuth_offset_rad + rad_per_ns * firings.offset_ns[channel];
    EXPECT_NEAR(static_cast<double>(found.x_m), 10.0 * std::cos(laser.elevation_rad) * std::cos(azimuth_rad), 2e-5);
    EXPECT_NEAR(static_cast<double>(found.y_m), -10.0 * std::cos(laser.elevation_rad) * std::sin(azimuth_rad), 2e-5);
    EXPECT_NEAR(static_cast<double>(found.z_m), 10.0 * std::sin(laser.elevation_rad), 2e-5);
    EXPECT_FLOAT_EQ(found.range_m, 10.0F);
    EXPECT_EQ(found.ring, laser.ring);
    EXPECT_EQ(found.intensity, 77);
    // The time is that of the block and of its channel, independent of the packet's first firing.
    const Duration to_last_block =
        its.time_of_last_column ? Duration{0} : static_cast<Duration::rep>(last_block) * firings.column_duration;
    EXPECT_EQ(decoder.time() + Duration{found.offset_ns},
              HesaiTestPacket::kTime + its.azimuth_delay + to_last_block + Duration{firings.offset_ns[channel]});
  }
}

TEST_P(HesaiModel, ColumnsAreSpacedByTheirDuration) {
  const ModelSpec& its = spec(GetParam());
  for (const std::uint8_t mode : {kStrongest, kDual}) {
    const HesaiTestPacket bytes{GetParam(), mode};
    Decoder decoder;
    LidarPacket packet;
    ASSERT_EQ(decoder.decode(bytes.payload(), packet), std::nullopt);
    const std::size_t columns = its.layout.blocks / returns_of(*decoder.return_mode());
    const std::size_t banks = (its.layout.channels + 15) / 16;
    const std::size_t silent = its.sequences[0].silent_banks == 0 ? 0 : 2;
    EXPECT_EQ(packet.count, its.layout.blocks * (banks - silent));
    EXPECT_EQ(packet.duration, static_cast<Duration::rep>(columns) * its.sequences[0].column_duration);
    EXPECT_EQ(packet.duration, decoder.nominal_duration());
    EXPECT_DOUBLE_EQ(decoder.rotation_rate_rpm(), 600.0);
    std::int32_t least_ns = packet.storage[0].offset_ns[0];
    for (const FiringGroup& group : packet.firing_groups())
      for (std::size_t k = 0; k < FiringGroup::kLasers; ++k)
        if (group.first_laser + k < its.layout.channels)
          least_ns = std::min(least_ns, group.offset_ns[k]);
    EXPECT_EQ(least_ns, 0);
  }
}

TEST_P(HesaiModel, AnotherModelThanConfiguredIsRejected) {
  const HesaiTestPacket bytes{GetParam(), kDual};
  LidarPacket packet;
  for (const Model other : all_models()) {
    Decoder decoder{{.model = other}};
    const auto error = decoder.decode(bytes.payload(), packet);
    EXPECT_EQ(error, other == GetParam() ? std::nullopt : std::optional{PacketError::model}) << to_string(other);
    EXPECT_EQ(decoder.recognised()->model, GetParam());
  }
}

TEST_P(HesaiModel, EveryOtherLengthIsRejected) {
  const HesaiTestPacket bytes{GetParam(), kDual};
  std::vector<std::byte> longer(bytes.payload().begin(), bytes.payload().end());
  longer.resize(longer.size() + 100);
  const bool has_number_at_will = !spec(GetParam()).layout.has_checksums;
  for (std::size_t length = 0; length <= longer.size(); ++length) {
    LidarPacket packet;
    Decoder decoder;
    const auto error = decoder.decode(std::span<const std::byte>{longer}.first(length), packet);
    const bool fits = length == bytes.payload().size() || (has_number_at_will && length + 4 == bytes.payload().size());
    EXPECT_EQ(!error.has_value(), fits) << length;
  }
}

TEST_P(HesaiModel, AnyBytesGiveFiniteReturnsWithinBounds) {
  std::mt19937 random{1};
  Decoder decoder;
  for (int round = 0; round < 3000; ++round) {
    HesaiTestPacket bytes{GetParam(), round % 2 == 0 ? kStrongest : kDual};
    for (int changes = static_cast<int>(random() % 40); changes > 0; --changes)
      bytes.set_byte(random() % bytes.payload().size(), static_cast<std::uint8_t>(random()));
    if (round % 3 == 0)
      bytes.seal();
    LidarPacket packet;
    if (decoder.decode(bytes.payload(), packet))
      continue;
    ASSERT_LE(packet.count, LidarPacket::kMaxFiringGroups);
    ASSERT_LT(packet.first_azimuth_cdeg, kCdegPerTurn);
    for (const LidarReturn& one : test::returns_of(packet)) {
      ASSERT_TRUE(std::isfinite(one.x_m + one.y_m + one.z_m));
      ASSERT_LT(one.ring, kMaxChannels);
      ASSERT_LT(Duration{one.offset_ns}, packet.duration + decoder.nominal_duration());
    }
  }
}

INSTANTIATE_TEST_SUITE_P(, HesaiModel, testing::ValuesIn(all_models()),
                         [](const auto& one) { return std::string{to_string(one.param)}; });

TEST(HesaiDecoder, TimeIsThatOfTheFirstFiring) {
  LidarPacket packet;
  Decoder decoder;
  const auto time_of = [&](Model model, std::uint8_t mode) {
    const HesaiTestPacket bytes{model, mode};
    EXPECT_EQ(decoder.decode(bytes.payload(), packet), std::nullopt);
    return decoder.time() - HesaiTestPacket::kTime;
  };
  // Pandar40P: the tenth block ends 28.58 us before the packet's time, and begins with laser 8, 54.67 us earlier.
  EXPECT_EQ(time_of(Model::pandar40p, kStrongest), nanoseconds{-28'580 - 9 * 55'560 - 54'670});
  EXPECT_EQ(time_of(Model::pandar40p, kDual), nanoseconds{-28'580 - 4 * 55'560 - 54'670});
  // XT32: the eighth block is triggered at the packet's time, and fires 5.632 + 0.368 us later.
  EXPECT_EQ(time_of(Model::xt32, kStrongest), nanoseconds{-7 * 50'000 + 6'000});
  EXPECT_EQ(time_of(Model::xt32, kDual), nanoseconds{-3 * 50'000 + 6'000});
  EXPECT_EQ(time_of(Model::xt32m, kTriple), nanoseconds{-1 * 50'000 + 6'000});
  // QT128: the first block begins 9 us after the packet's time, its first laser 0.6 us later.
  EXPECT_EQ(time_of(Model::qt128, kStrongest), nanoseconds{9'600});
  EXPECT_EQ(time_of(Model::qt128, kDual), nanoseconds{9'600});
}

TEST(HesaiDecoder, DuplicateReturnOfAPulseIsDropped) {
  const auto ranges_of = [](std::uint8_t mode, const std::vector<std::uint16_t>& distances) {
    HesaiTestPacket bytes{Model::xt32m, mode};
    for (std::size_t block = 0; block < distances.size(); ++block)
      bytes.set_return(block, 3, distances[block]);
    Decoder decoder;
    LidarPacket packet;
    EXPECT_EQ(decoder.decode(bytes.payload(), packet), std::nullopt);
    std::vector<float> ranges_m;
    for (const LidarReturn& one : test::returns_of(packet))
      ranges_m.push_back(one.range_m);
    return ranges_m;
  };
  EXPECT_EQ(ranges_of(kDual, {2500, 2500}), (std::vector{10.0F}));
  EXPECT_EQ(ranges_of(kDual, {2500, 1250}), (std::vector{10.0F, 5.0F}));
  EXPECT_EQ(ranges_of(kDual, {0, 1250}), (std::vector{5.0F}));
  EXPECT_EQ(ranges_of(kTriple, {2500, 2500, 2500}), (std::vector{10.0F}));
  EXPECT_EQ(ranges_of(kTriple, {2500, 1250, 1250}), (std::vector{10.0F, 5.0F}));
  EXPECT_EQ(ranges_of(kTriple, {2500, 1250, 2500}), (std::vector{10.0F, 5.0F}));
  EXPECT_EQ(ranges_of(kTriple, {2500, 1250, 625}), (std::vector{10.0F, 5.0F, 2.5F}));
}

TEST(HesaiDecoder, ReturnsBelowTheLeastRangeAreDropped) {
  for (const auto& [distance, returns] : {std::pair{124, 0U}, std::pair{125, 1U}, std::pair{1, 0U}}) {
    HesaiTestPacket bytes{Model::xt32m, kStrongest}; // minimum range 0.5 m
    bytes.set_return(0, 0, static_cast<std::uint16_t>(distance));
    Decoder decoder;
    LidarPacket packet;
    ASSERT_EQ(decoder.decode(bytes.payload(), packet), std::nullopt);
    EXPECT_EQ(test::returns_of(packet).size(), returns) << distance;
  }
}

TEST(HesaiDecoder, UnitOfDistanceIsThatOfTheHeader) {
  for (const int unit_mm : {1, 2, 4, 5}) {
    HesaiTestPacket bytes{Model::xt32, kStrongest};
    bytes.set_byte(9, static_cast<std::uint8_t>(unit_mm));
    bytes.set_return(0, 0, 1000);
    Decoder decoder;
    EXPECT_FLOAT_EQ(only_return(decoder, bytes).range_m, static_cast<float>(unit_mm)) << unit_mm;
  }
  HesaiTestPacket none{Model::xt32, kStrongest};
  none.set_byte(9, 0);
  LidarPacket packet;
  EXPECT_EQ(Decoder{}.decode(none.payload(), packet), PacketError::model);
}

TEST(HesaiDecoder, DateIsReadInBothForms) {
  Decoder decoder;
  LidarPacket packet;
  HesaiTestPacket bytes{Model::xt32, kStrongest, seconds{1'709'251'199}}; // last second of 29 February 2024
  ASSERT_EQ(decoder.decode(bytes.payload(), packet), std::nullopt);
  const Duration to_first = decoder.time() - seconds{1'709'251'199};
  bytes.set_microseconds(1'000'000);
  ASSERT_EQ(decoder.decode(bytes.payload(), packet), std::nullopt);
  EXPECT_EQ(decoder.time() - to_first, seconds{1'709'251'200});
  for (std::size_t i = 0; i < 6; ++i)
    bytes.set_date_byte(i, std::array<std::uint8_t, 6>{0, 0, 0x65, 0x53, 0xF1, 0x00}[i]);
  bytes.set_microseconds(7);
  ASSERT_EQ(decoder.decode(bytes.payload(), packet), std::nullopt);
  EXPECT_EQ(decoder.time() - to_first, seconds{1'700'000'000} + microseconds{7});
}

/// The epoch differs between models, and between firmware versions of a model.
TEST(HesaiDecoder, YearCountsFrom1900OrFrom2000) {
  for (std::size_t i = 0; i < kModels; ++i)
    for (const int year_zero : {1900, 2000}) {
      HesaiTestPacket bytes{static_cast<Model>(i), kStrongest};
      Decoder decoder;
      LidarPacket packet;
      ASSERT_EQ(decoder.decode(bytes.payload(), packet), std::nullopt);
      const Duration time = decoder.time();
      bytes.set_time(HesaiTestPacket::kTime, year_zero);
      bytes.seal();
      ASSERT_EQ(decoder.decode(bytes.payload(), packet), std::nullopt) << to_string(static_cast<Model>(i));
      EXPECT_EQ(decoder.time(), time) << to_string(static_cast<Model>(i)) << ' ' << year_zero;
    }
}

/// Without GPS or PTP a lidar may count from the year 2000, whose byte is 0 if years are counted from there.
TEST(HesaiDecoder, UnlockedClockFrom2000IsRead) {
  HesaiTestPacket bytes{Model::pandar40p, kStrongest};
  for (std::size_t i = 0; i < 6; ++i)
    bytes.set_date_byte(i, std::array<std::uint8_t, 6>{0, 1, 1, 0, 0, 7}[i]);
  bytes.seal();
  Decoder decoder;
  LidarPacket packet;
  ASSERT_EQ(decoder.decode(bytes.payload(), packet), std::nullopt);
  EXPECT_EQ(std::chrono::round<seconds>(decoder.time()), seconds{946'684'807});
}

TEST(HesaiDecoder, InvalidDateIsRejected) {
  struct Odd {
    std::size_t byte;
    std::uint8_t value;
  };
  for (const Odd odd : {Odd{1, 0}, Odd{1, 13}, Odd{2, 0}, Odd{2, 32}, Odd{3, 24}, Odd{4, 60}, Odd{5, 61}}) {
    HesaiTestPacket bytes{Model::xt32, kStrongest};
    bytes.set_date_byte(odd.byte, odd.value);
    LidarPacket packet;
    EXPECT_EQ(Decoder{}.decode(bytes.payload(), packet), PacketError::time) << odd.byte << ' ' << int{odd.value};
  }
  LidarPacket packet;
  HesaiTestPacket late{Model::xt32, kStrongest};
  late.set_microseconds(1'000'001);
  EXPECT_EQ(Decoder{}.decode(late.payload(), packet), PacketError::time);
  HesaiTestPacket far{Model::xt32, kStrongest};
  for (std::size_t i = 0; i < 6; ++i)
    far.set_date_byte(i, i == 0 ? 0 : 255);
  EXPECT_EQ(Decoder{}.decode(far.payload(), packet), PacketError::time);
}

TEST(HesaiDecoder, ForeignPacketsAreRejectedWithTheReason) {
  LidarPacket packet;
  const auto error_of = [&](HesaiTestPacket bytes, const auto& change) {
    change(bytes);
    return Decoder{}.decode(bytes.payload(), packet);
  };
  const HesaiTestPacket xt32{Model::xt32, kStrongest}, pandar40p{Model::pandar40p, kStrongest};
  EXPECT_EQ(error_of(xt32, [](auto& bytes) { bytes.set_byte(0, 0xED); }), PacketError::flag);
  EXPECT_EQ(error_of(xt32, [](auto& bytes) { bytes.set_byte(2, 9); }), PacketError::model) << "version";
  EXPECT_EQ(error_of(xt32, [](auto& bytes) { bytes.set_byte(6, 33); }), PacketError::model) << "lasers";
  EXPECT_EQ(error_of(xt32, [](auto& bytes) { bytes.set_return_mode(0x40); }), PacketError::model);
  EXPECT_EQ(error_of(xt32, [](auto& bytes) { bytes.set_return_mode(kTriple); }), PacketError::model) << "8 blocks";
  EXPECT_EQ(error_of(xt32, [](auto& bytes) { bytes.set_azimuth(3, 36'001); }), PacketError::azimuth);
  EXPECT_EQ(error_of(xt32, [](auto& bytes) { bytes.set_azimuth(7, 36'000); }), std::nullopt) << "which is 0";
  EXPECT_EQ(error_of(xt32, [](auto& bytes) { bytes.set_motor_speed(3601); }), PacketError::azimuth);
  EXPECT_EQ(error_of(pandar40p, [](auto& bytes) { bytes.set_byte(124 * 9, 0); }), PacketError::flag);
  EXPECT_EQ(error_of(xt32,
                     [](auto& bytes) {
                       for (std::size_t block = 0; block < 8; ++block)
                         bytes.set_azimuth(block, static_cast<std::uint16_t>(3000 * block));
                     }),
            PacketError::azimuth)
      << "a turn that no motor makes";
}

TEST(HesaiDecoder, CalibrationMustHaveAsManyLasers) {
  Calibration calibration;
  calibration.laser_count = 32;
  calibration.storage[0] = {0.1, 0.2, 0};
  calibration.assign_rings();
  HesaiTestPacket bytes{Model::xt32, kStrongest, HesaiTestPacket::kTime, 0, 0.0};
  bytes.set_return(0, 0, kTenMetres);
  Decoder decoder{{.calibration = calibration}};
  const LidarReturn found = only_return(decoder, bytes);
  EXPECT_NEAR(static_cast<double>(found.x_m), 10.0 * std::cos(0.1) * std::cos(0.2), 1e-5);
  EXPECT_NEAR(static_cast<double>(found.y_m), -10.0 * std::cos(0.1) * std::sin(0.2), 1e-5);
  EXPECT_NEAR(static_cast<double>(found.z_m), 10.0 * std::sin(0.1), 1e-5);
  EXPECT_EQ(found.ring, 31);
  const HesaiTestPacket sixteen{Model::xt16, kStrongest};
  LidarPacket packet;
  EXPECT_EQ(decoder.decode(sixteen.payload(), packet), PacketError::model);
}

/// The laser has turned, in either direction, beyond the block's azimuth when it fires.
TEST(HesaiDecoder, TurnsCounterclockwiseIfItsAzimuthsDo) {
  for (const auto& [model, mode] : {std::pair{Model::xt32, kStrongest}, std::pair{Model::qt128, kDual}}) {
    const ModelSpec& its = spec(model);
    Decoder decoder;
    std::vector<int> azimuths_cdeg;
    for (int i = 0; i < 3; ++i) {
      const Duration passed = i * packet_duration(model, *return_mode_from_byte(mode));
      const double turned_cdeg = -36000.0 * 10.0 * to_seconds(passed);
      HesaiTestPacket bytes{model,
                            mode,
                            HesaiTestPacket::kTime + passed,
                            static_cast<std::uint16_t>(9000 + std::lround(turned_cdeg)),
                            -600.0,
                            i % 2 == 0 ? 0U : 1U};
      const std::size_t channel = its.layout.channels - 1;
      bytes.set_return(0, channel, kTenMetres);
      bytes.seal();
      LidarPacket packet;
      ASSERT_EQ(decoder.decode(bytes.payload(), packet), std::nullopt);
      azimuths_cdeg.push_back(packet.first_azimuth_cdeg);
      if (i < 2)
        continue;
      const Laser& laser = its.calibration.storage[channel];
      const double fired_ns = its.sequences[0].offset_ns[channel];
      const double azimuth_rad = (9000.0 + std::round(turned_cdeg)) * std::numbers::pi / 18000.0 +
                                 laser.azimuth_offset_rad - 20e-9 * std::numbers::pi * fired_ns;
      const LidarReturn found = test::returns_of(packet).front();
      EXPECT_NEAR(static_cast<double>(found.x_m), 10.0 * std::cos(laser.elevation_rad) * std::cos(azimuth_rad), 2e-5);
    }
    EXPECT_GT(azimuths_cdeg[2], azimuths_cdeg[1]) << to_string(model);
  }
}

/// With a limited field of view, the columns after the blind sector are later by its duration.
TEST(HesaiDecoder, BlindSectorWithinAPacketCountsInTime) {
  HesaiTestPacket bytes{Model::xt32, kStrongest}; // 18 cdeg per column
  for (std::size_t block = 4; block < 8; ++block)
    bytes.set_azimuth(block, static_cast<std::uint16_t>(18 * (block + 500)));
  bytes.set_return(3, 0, kTenMetres);
  bytes.set_return(4, 0, kTenMetres);
  Decoder decoder;
  LidarPacket packet;
  ASSERT_EQ(decoder.decode(bytes.payload(), packet), std::nullopt);
  const auto returns = test::returns_of(packet);
  ASSERT_EQ(returns.size(), 2U);
  EXPECT_EQ(returns[1].offset_ns - returns[0].offset_ns, 501 * 50'000);
  EXPECT_EQ(packet.duration, 508 * nanoseconds{50'000});
  EXPECT_EQ(decoder.time(), HesaiTestPacket::kTime - 507 * nanoseconds{50'000} + nanoseconds{6'000});
}

/// Two columns leave no third to detect a damaged azimuth by.
TEST(HesaiDecoder, ChecksumConfirmsABlindSectorBetweenTwoColumns) {
  for (const Model model : {Model::qt128, Model::ot128}) {
    const std::int64_t column_ns = spec(model).sequences[0].column_duration.count();
    const double turn_cdeg = 360'000.0 * 1e-9 * static_cast<double>(column_ns);
    HesaiTestPacket bytes{model, kStrongest};
    bytes.set_azimuth(1, static_cast<std::uint16_t>(std::lround(500 * turn_cdeg)));
    LidarPacket packet;
    EXPECT_EQ(Decoder{}.decode(bytes.payload(), packet), PacketError::azimuth);
    bytes.seal();
    Decoder decoder;
    ASSERT_EQ(decoder.decode(bytes.payload(), packet), std::nullopt);
    EXPECT_EQ(packet.duration, nanoseconds{501 * column_ns});
    EXPECT_NEAR(packet.first_azimuth_cdeg, 0, 1);
    bytes.set_motor_speed(0);
    bytes.seal();
    EXPECT_EQ(Decoder{}.decode(bytes.payload(), packet), PacketError::azimuth) << "a motor that rests passes no sector";
  }
}

TEST(HesaiDecoder, ChecksumsAreEnforcedOnceOneWasRight) {
  for (const Model model : {Model::qt128, Model::ot128}) {
    HesaiTestPacket good{model, kDual};
    good.seal();
    HesaiTestPacket bad_body = good, bad_tail = good;
    bad_body.set_byte(400, 1);
    bad_tail.set_byte(bad_tail.tail() + 1, 1);
    Decoder decoder;
    LidarPacket packet;
    EXPECT_EQ(decoder.decode(bad_body.payload(), packet), std::nullopt) << "it may be one that has none";
    EXPECT_FALSE(decoder.has_checksums());
    EXPECT_EQ(decoder.decode(good.payload(), packet), std::nullopt);
    EXPECT_TRUE(decoder.has_checksums());
    EXPECT_EQ(decoder.decode(bad_body.payload(), packet), PacketError::checksum);
    EXPECT_EQ(decoder.decode(bad_tail.payload(), packet), PacketError::checksum);
    EXPECT_EQ(decoder.decode(good.payload(), packet), std::nullopt);
  }
}

/// The QT128 fires 96 of 128 channels per column: 1 to 32 in every second one, 33 to 64 in the others.
TEST(HesaiDecoder, SequenceOfAQt128FollowsItsModeFlag) {
  const ModelSpec& its = spec(Model::qt128);
  EXPECT_EQ(its.sequences[0].offset_ns[34], 2'312);
  EXPECT_EQ(its.sequences[1].offset_ns[0], 2'312);
  EXPECT_EQ(its.sequences[1].offset_ns[64], 600);
  EXPECT_EQ(its.sequences[0].offset_ns[98], 600);
  EXPECT_EQ(its.sequences[1].offset_ns[127], 48'976);
  for (const std::size_t sequence : {0U, 1U}) {
    HesaiTestPacket bytes{Model::qt128, kDual, HesaiTestPacket::kTime, 0, 600.0, sequence};
    bytes.set_return(0, 64, kTenMetres);
    bytes.seal();
    Decoder decoder;
    const LidarReturn found = only_return(decoder, bytes);
    EXPECT_EQ(found.offset_ns, its.sequences[sequence].offset_ns[64] - 600);
  }
}

/// In high resolution an OT128 has twice the columns, and its channels fire in half the time.
TEST(HesaiDecoder, HighResolutionOfAnOt128IsReadFromItsState) {
  HesaiTestPacket bytes{Model::ot128, kStrongest, HesaiTestPacket::kTime, 0, 600.0, 1};
  bytes.set_return(1, 0, kTenMetres);
  bytes.seal();
  Decoder decoder;
  const LidarReturn found = only_return(decoder, bytes);
  EXPECT_EQ(decoder.nominal_duration(), 2 * nanoseconds{27'778});
  EXPECT_EQ(decoder.time() + Duration{found.offset_ns},
            HesaiTestPacket::kTime + nanoseconds{43'346} + nanoseconds{49'758 - 27'778});
}

TEST(HesaiLooks, UnsupportedModelsAreNamed) {
  const auto look_of = [](int major, int minor, int lasers, int blocks, int status = 0) {
    std::vector<std::byte> payload(1000);
    for (const auto& [at, value] :
         {std::pair{0, 0xEE}, {1, 0xFF}, {2, major}, {3, minor}, {4, status}, {6, lasers}, {7, blocks}})
      payload[static_cast<std::size_t>(at)] = static_cast<std::byte>(value);
    return look_at(payload);
  };
  EXPECT_EQ(look_of(4, 3, 128, 2)->name, "AT128");
  EXPECT_EQ(look_of(1, 4, 128, 2)->name, "Pandar128");
  EXPECT_EQ(look_of(1, 4, 128, 2)->model, std::nullopt);
  EXPECT_EQ(look_of(1, 4, 128, 2, 128)->model, Model::ot128);
  EXPECT_EQ(look_of(1, 4, 128, 2, 136)->model, Model::ot128);
  EXPECT_EQ(look_of(1, 4, 128, 2, 137)->name, "JT128") << "the layout of an OT128, with other angles";
  EXPECT_EQ(look_of(1, 4, 128, 2, 137)->model, std::nullopt);
  EXPECT_EQ(look_of(3, 1, 32, 4)->model, std::nullopt) << "QT32";
  EXPECT_EQ(look_of(99, 1, 32, 4)->name, "of an unknown model");
  EXPECT_EQ(look_at(std::vector<std::byte>(1262)), std::nullopt);
  EXPECT_EQ(look_at({}), std::nullopt);
}

} // namespace
} // namespace locus::hesai

// SPDX-License-Identifier: Apache-2.0
#include "drivers/ouster/decoder.hpp"

#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "drivers/ouster_test_packet.hpp"
#include "support/returns.hpp"

namespace locus::ouster {
namespace {

using test::ouster_metadata;
using test::OusterTestPacket;

const std::array<Profile, kProfiles> kAll = [] {
  std::array<Profile, kProfiles> all{};
  for (std::size_t i = 0; i < kProfiles; ++i)
    all[i] = static_cast<Profile>(i);
  return all;
}();

/// Returns the position of a pixel in the sensor frame by the manual: the beam starts on a circle about the lidar
/// frame's z axis, and its length is the range minus the radius of that circle.
Eigen::Vector3d place_of(const Metadata& metadata, std::size_t column, std::size_t pixel, double range_m) {
  const double encoder =
      2.0 * std::numbers::pi * (1.0 - static_cast<double>(column) / static_cast<double>(metadata.columns_per_frame));
  const double azimuth = encoder - metadata.azimuth_rad[pixel], altitude = metadata.altitude_rad[pixel];
  const double n = metadata.beam_origin_radius_m;
  const Eigen::Vector3d p_lidar{(range_m - n) * std::cos(azimuth) * std::cos(altitude) + n * std::cos(encoder),
                                (range_m - n) * std::sin(azimuth) * std::cos(altitude) + n * std::sin(encoder),
                                (range_m - n) * std::sin(altitude)};
  return metadata.T_sensor_lidar * p_lidar;
}

TEST(OusterDecoder, PlacesEveryPixelOfEveryProfile) {
  for (const Profile profile : kAll) {
    for (const std::size_t pixels : {16U, 32U, 64U, 128U}) {
      const Metadata metadata = ouster_metadata(profile, pixels);
      OusterTestPacket bytes{metadata, 1010};
      const auto range_mm = [](std::size_t i, std::size_t pixel) {
        return static_cast<std::uint32_t>(8 * (100 + 1000 * (i % 16) + 13 * pixel));
      };
      for (std::size_t i = 0; i < 16; ++i)
        for (std::size_t pixel = 0; pixel < pixels; ++pixel)
          bytes.set_return(i, pixel, range_mm(i, pixel), static_cast<std::uint8_t>(pixel + i));
      bytes.seal();
      Decoder decoder{metadata};
      LidarPacket packet;
      ASSERT_EQ(decoder.decode(bytes.payload(), packet), std::nullopt);
      const std::vector<LidarReturn> returns = test::returns_of(packet);
      ASSERT_EQ(returns.size(), 16 * pixels);
      for (std::size_t n = 0; n < returns.size(); ++n) {
        const std::size_t i = n / pixels, pixel = n % pixels, column = (1010 + i) % 1024;
        const double range_m = 1e-3 * range_mm(i, pixel);
        const LidarReturn& found = returns[n];
        const Eigen::Vector3d expected = place_of(metadata, column, pixel, range_m);
        EXPECT_NEAR(found.x_m, expected.x(), 5e-5) << spec(profile).name << ' ' << i << ' ' << pixel;
        EXPECT_NEAR(found.y_m, expected.y(), 5e-5);
        EXPECT_NEAR(found.z_m, expected.z(), 5e-5);
        EXPECT_NEAR(found.range_m, range_m, 2e-7 * range_m) << "two roundings";
        EXPECT_EQ(found.intensity, static_cast<std::uint8_t>(pixel + i));
        EXPECT_EQ(found.ring, pixels - 1 - pixel);
        EXPECT_EQ(found.offset_ns, static_cast<std::int32_t>(i) * OusterTestPacket::kColumnNs);
      }
    }
  }
}

/// The lengths and bits of a pixel are those of the maker's SDK: bytes, and where ranges and reflectivities are.
TEST(OusterDecoder, ReadsTheBitsThatTheMakerDescribesForEachProfile) {
  struct Described {
    const char* name;
    std::size_t bytes, first_bit, bits, up, reflectivity_bit, second_bit, second_reflectivity_bit;
  };
  constexpr auto kDescribed = std::to_array<Described>({{"LEGACY", 12, 0, 20, 0, 32, 0, 0},
                                                        {"RNG19_RFL8_SIG16_NIR16", 12, 0, 19, 0, 32, 0, 0},
                                                        {"RNG19_RFL8_SIG16_NIR16_DUAL", 16, 0, 19, 0, 24, 32, 56},
                                                        {"RNG15_RFL8_NIR8", 4, 0, 15, 3, 16, 0, 0},
                                                        {"RNG15_RFL8_NIR8_DUAL", 8, 0, 15, 3, 16, 32, 48},
                                                        {"FUSA_RNG15_RFL8_NIR8_DUAL", 8, 0, 15, 3, 16, 32, 48},
                                                        {"RNG15_RFL8_NIR8_ZONE16", 8, 0, 15, 3, 16, 0, 0},
                                                        {"RNG19_RFL8_SIG16_NIR16_ZONE16", 12, 0, 19, 0, 32, 0, 0},
                                                        {"RNG19_RFL8_SIG16_ZONE16_DUAL", 16, 0, 19, 0, 24, 32, 56},
                                                        {"RNG15_RFL8_WIN8", 4, 0, 15, 3, 16, 0, 0},
                                                        {"RNG19_RFL8_SIG16_NIR16_RGB16", 16, 0, 19, 0, 24, 0, 0},
                                                        {"RNG19_RFL8_SIG16_NIR16_RGB16_DUAL", 20, 0, 19, 0, 24, 32, 56},
                                                        {"FIVE_WORD_PIXEL", 20, 0, 19, 0, 24, 32, 56}});
  static_assert(kDescribed.size() == kProfiles);
  for (const Described& one : kDescribed) {
    const auto profile = profile_from_string(one.name);
    ASSERT_TRUE(profile) << one.name;
    const Metadata metadata = ouster_metadata(*profile, 16);
    OusterTestPacket bytes{metadata};
    const std::size_t pixel = (*profile == Profile::legacy ? 16U : 32U + 12U) + 5 * one.bytes;
    const auto set = [&](std::size_t bit, std::uint64_t value, std::size_t size) {
      bytes.put(pixel + bit / 8, value, size);
    };
    set(0, ~std::uint64_t{0}, std::min<std::size_t>(one.bytes, 8)); // bits around the fields are other fields
    const std::uint64_t flags = ~((1ULL << one.bits) - 1);
    const std::size_t size = one.bits == 15 ? 2 : 3;
    set(one.first_bit, 1234 | flags, size);
    set(one.reflectivity_bit, 77, 1);
    const bool is_dual = one.second_bit > 0;
    if (is_dual) {
      set(one.second_bit, 2345 | flags, size);
      set(one.second_reflectivity_bit, 88, 1);
    }
    bytes.seal();
    Decoder decoder{metadata};
    LidarPacket packet;
    ASSERT_EQ(decoder.decode(bytes.payload(), packet), std::nullopt) << one.name;
    const auto returns = test::returns_of(packet);
    ASSERT_EQ(returns.size(), is_dual ? 2U : 1U) << one.name;
    EXPECT_FLOAT_EQ(returns[0].range_m, 1e-3F * static_cast<float>(1234U << one.up)) << one.name;
    EXPECT_EQ(returns[0].intensity, 77) << one.name;
    EXPECT_EQ(returns[0].ring, 10) << one.name;
    if (is_dual) {
      EXPECT_FLOAT_EQ(returns[1].range_m, 1e-3F * static_cast<float>(2345U << one.up)) << one.name;
      EXPECT_EQ(returns[1].intensity, 88) << one.name;
    }
  }
}

/// Any profile but the legacy one may come with the header of functional safety, whose offsets differ.
TEST(OusterDecoder, ReadsTheHeaderOfFunctionalSafetyWithAnyProfile) {
  Metadata metadata = ouster_metadata(Profile::rng19);
  metadata.safety_header = true;
  OusterTestPacket bytes{metadata, 0, 1'000'000'000, 0x12345};
  bytes.set_return(3, 4, 5000);
  Decoder decoder{metadata};
  LidarPacket packet;
  ASSERT_EQ(decoder.decode(bytes.payload(), packet), std::nullopt);
  EXPECT_EQ(test::returns_of(packet).size(), 1U);
  const auto recognised = format_of_lidar_packet(bytes.payload());
  ASSERT_TRUE(recognised);
  EXPECT_EQ(recognised->header(bytes.payload()).serial_number, metadata.serial_number);
  EXPECT_EQ(recognised->header(bytes.payload()).frame_id, 0x12345U);
  bytes.put(0, 2, 1);
  EXPECT_EQ(decoder.decode(bytes.payload(), packet), PacketError::flag);
  EXPECT_FALSE(format_of_lidar_packet(bytes.payload()));
}

TEST(OusterFormat, LengthOfAPacketMayLeaveTheNumberOfPixelsOpen) {
  const auto bytes_of = [](Profile profile, std::size_t pixels) {
    return PacketFormat{profile, false, pixels, 16}.packet_bytes;
  };
  EXPECT_EQ(pixels_of_length(bytes_of(Profile::legacy, 64)), 64U);
  EXPECT_EQ(pixels_of_length(bytes_of(Profile::rng19, 128)), 128U);
  EXPECT_EQ(pixels_of_length(bytes_of(Profile::rng15, 128)), 0U) << "as long as rng19_dual with 32";
  EXPECT_EQ(pixels_of_length(1206), 0U);
}

TEST(OusterDecoder, ForwardIsHalfATurnOfTheEncoder) {
  Metadata metadata = ouster_metadata();
  metadata.azimuth_rad[0] = metadata.altitude_rad[0] = 0.0;
  OusterTestPacket bytes{metadata, 512};
  bytes.set_return(0, 0, 10'000);
  bytes.seal();
  Decoder decoder{metadata};
  LidarPacket packet;
  ASSERT_EQ(decoder.decode(bytes.payload(), packet), std::nullopt);
  const std::vector<LidarReturn> returns = test::returns_of(packet);
  ASSERT_EQ(returns.size(), 1U);
  EXPECT_NEAR(returns[0].x_m, 10.0F, 1e-4F);
  EXPECT_NEAR(returns[0].y_m, 0.0F, 1e-4F);
  EXPECT_EQ(packet.first_azimuth_cdeg, 0) << "of the sensor's x axis";
  EXPECT_EQ(decoder.decode(OusterTestPacket{metadata, 768}.payload(), packet), std::nullopt);
  EXPECT_EQ(packet.first_azimuth_cdeg, 9000) << "it turns clockwise";
}

TEST(OusterDecoder, BeamsMayBeginHigherThanTheLidarFrame) {
  Metadata metadata = ouster_metadata();
  metadata.beam_origin_radius_m = 0.03;
  metadata.beam_origin_height_m = 0.04;
  metadata.azimuth_rad[0] = metadata.altitude_rad[0] = 0.0;
  OusterTestPacket bytes{metadata, 0};
  bytes.set_return(0, 0, 2'000);
  bytes.seal();
  Decoder decoder{metadata};
  LidarPacket packet;
  ASSERT_EQ(decoder.decode(bytes.payload(), packet), std::nullopt);
  const LidarReturn found = test::returns_of(packet).at(0);
  EXPECT_NEAR(found.x_m, -(2.0F - 0.05F + 0.03F), 1e-5F) << "5 cm of the range lie before the beam's origin";
  EXPECT_NEAR(found.z_m, 0.04F + 0.03618F, 1e-5F);
}

TEST(OusterDecoder, SecondReturnIsAGroupOfItsOwn) {
  for (const Profile profile : {Profile::rng19_dual, Profile::rng15_dual, Profile::fusa_rng15_dual}) {
    const Metadata metadata = ouster_metadata(profile);
    OusterTestPacket bytes{metadata};
    bytes.set_return(3, 17, 4'000, 50);
    bytes.set_return(3, 17, 8'000, 60, 1);
    bytes.set_return(3, 18, 4'000, 70);
    bytes.set_return(3, 18, 4'000, 80, 1); // identical return
    bytes.seal();
    Decoder decoder{metadata};
    LidarPacket packet;
    ASSERT_EQ(decoder.decode(bytes.payload(), packet), std::nullopt);
    EXPECT_EQ(packet.count, 2U * 2U * 16U);
    const std::vector<LidarReturn> returns = test::returns_of(packet);
    ASSERT_EQ(returns.size(), 3U);
    EXPECT_NEAR(returns[0].range_m, 4.0F, 1e-5F);
    EXPECT_EQ(returns[1].intensity, 70);
    EXPECT_NEAR(returns[2].range_m, 8.0F, 1e-5F);
    EXPECT_EQ(returns[2].intensity, 60);
    EXPECT_EQ(returns[2].ring, returns[0].ring);
  }
}

TEST(OusterDecoder, InvalidColumnsAreLeftOutAndCountedWithinTheWindow) {
  for (const Profile profile : {Profile::legacy, Profile::rng15}) {
    Metadata metadata = ouster_metadata(profile);
    metadata.first_column = 2;
    metadata.last_column = 500;
    OusterTestPacket bytes{metadata, 0, 5'000'000};
    for (const std::size_t i : {0U, 1U, 7U})
      bytes.set_valid(i, false);
    bytes.set_time(0, 0);
    bytes.set_measurement_id(7, 60'000);
    bytes.seal();
    Decoder decoder{metadata};
    LidarPacket packet;
    ASSERT_EQ(decoder.decode(bytes.payload(), packet), std::nullopt);
    EXPECT_EQ(packet.count, 2U * 13U);
    EXPECT_EQ(decoder.invalid_columns(), 0U) << "0 and 1 lie outside the window, and what 7 is nobody knows";
    EXPECT_EQ(decoder.time().count(), 5'000'000 + 2 * OusterTestPacket::kColumnNs);
    EXPECT_EQ(decoder.first_column(), 2U);
    EXPECT_EQ(decoder.last_column(), 15U);
    EXPECT_EQ(packet.duration, Duration{13 * OusterTestPacket::kColumnNs} + decoder.column_duration());
    bytes.set_measurement_id(7, 7);
    bytes.seal();
    ASSERT_EQ(decoder.decode(bytes.payload(), packet), std::nullopt);
    EXPECT_EQ(decoder.invalid_columns(), 1U);
  }
}

TEST(OusterDecoder, RotationRateFollowsItsColumns) {
  const Metadata metadata = ouster_metadata();
  Decoder decoder{metadata};
  EXPECT_EQ(decoder.rotation_rate_rpm(), 0.0);
  LidarPacket packet;
  ASSERT_EQ(decoder.decode(OusterTestPacket{metadata, 1016}.payload(), packet), std::nullopt);
  EXPECT_NEAR(decoder.rotation_rate_rpm(), 600.0, 0.1) << "across the end of the turn";
  OusterTestPacket last_of_window{metadata, 32};
  for (std::size_t i = 1; i < 16; ++i)
    last_of_window.set_valid(i, false);
  last_of_window.seal();
  ASSERT_EQ(decoder.decode(last_of_window.payload(), packet), std::nullopt);
  EXPECT_NEAR(decoder.rotation_rate_rpm(), 600.0, 0.1) << "a single column tells none";
}

TEST(OusterDecoder, RejectsEveryOtherLength) {
  const Metadata metadata = ouster_metadata();
  const std::vector<std::byte> bytes(40'000);
  Decoder decoder{metadata};
  LidarPacket packet;
  for (std::size_t length = 0; length < bytes.size(); length += length < 100 ? 1 : 97)
    if (length != metadata.packet_format().packet_bytes) {
      EXPECT_EQ(decoder.decode(std::span{bytes}.first(length), packet), PacketError::length) << length;
    }
}

TEST(OusterDecoder, RejectsAbsurdPackets) {
  const Metadata metadata = ouster_metadata();
  const auto error_of = [&](const std::function<void(OusterTestPacket&)>& change) {
    OusterTestPacket bytes{metadata};
    change(bytes);
    bytes.seal();
    Decoder decoder{metadata};
    LidarPacket packet;
    return decoder.decode(bytes.payload(), packet);
  };
  EXPECT_EQ(error_of([](auto&) {}), std::nullopt);
  EXPECT_EQ(error_of([](auto& bytes) { bytes.put(0, 3, 2); }), PacketError::flag) << "zone packet";
  EXPECT_EQ(error_of([](auto& bytes) { bytes.put(7, 991'913'000'010, 5); }), PacketError::sender);
  EXPECT_EQ(error_of([](auto& bytes) { bytes.put(7, 0, 5); }), std::nullopt) << "says no serial number";
  EXPECT_EQ(error_of([](auto& bytes) { bytes.set_measurement_id(0, 1024); }), PacketError::azimuth);
  EXPECT_EQ(error_of([](auto& bytes) { bytes.set_measurement_id(5, 6); }), PacketError::azimuth);
  EXPECT_EQ(error_of([](auto& bytes) { bytes.set_time(0, ~std::uint64_t{0}); }), PacketError::time);
  EXPECT_EQ(error_of([](auto& bytes) { bytes.set_time(5, 0); }), PacketError::time) << "before the first";
  EXPECT_EQ(error_of([](auto& bytes) { bytes.set_time(5, 1'000'000'000); }), PacketError::time)
      << "not after the one before";
  EXPECT_EQ(error_of([](auto& bytes) { bytes.set_time(15, 1'200'000'000); }), PacketError::time) << "far after";
  EXPECT_EQ(error_of([](auto& bytes) {
              for (std::size_t i = 0; i < 16; ++i)
                bytes.set_valid(i, false);
            }),
            PacketError::flag);
}

TEST(OusterDecoder, EnforcesTheChecksumOnceItWasRight) {
  const Metadata metadata = ouster_metadata();
  OusterTestPacket good{metadata}, flipped{metadata};
  flipped.put(1000, 0xFF, 1);
  OusterTestPacket filled{metadata};
  filled.put(filled.payload().size() - 8, 0xDEADBEEF0000C0DE, 8);
  Decoder decoder{metadata};
  LidarPacket packet;
  EXPECT_EQ(decoder.decode(filled.payload(), packet), std::nullopt) << "as older firmware does";
  EXPECT_FALSE(decoder.has_checksums());
  EXPECT_EQ(decoder.decode(good.payload(), packet), std::nullopt);
  EXPECT_TRUE(decoder.has_checksums());
  EXPECT_EQ(decoder.decode(flipped.payload(), packet), PacketError::checksum);
  EXPECT_EQ(decoder.decode(filled.payload(), packet), PacketError::checksum);
  EXPECT_EQ(decoder.decode(good.payload(), packet), std::nullopt);
}

struct Mode {
  std::size_t columns;
  int frames_per_s;
};
constexpr std::array kModes{Mode{512, 10},  Mode{512, 20},  Mode{1024, 10},
                            Mode{1024, 20}, Mode{2048, 10}, Mode{4096, 5}};

Metadata metadata_of(Mode mode) {
  Metadata metadata = ouster_metadata(Profile::rng19, 32, mode.columns);
  metadata.frames_per_s = mode.frames_per_s;
  return metadata;
}

/// Returns a packet of a restarted sensor, with the column spacing of its mode.
OusterTestPacket restarted(Metadata sensor, std::size_t first_column, std::uint64_t time_ns, std::uint32_t frame_id) {
  sensor.init_id = 4711;
  const auto columns_per_s = sensor.frames_per_s * static_cast<double>(sensor.columns_per_frame);
  OusterTestPacket bytes{sensor, first_column, time_ns, frame_id};
  for (std::size_t column = 0; column < 16; ++column)
    bytes.set_time(
        column, time_ns + static_cast<std::uint64_t>(std::llround(1e9 * static_cast<double>(column) / columns_per_s)));
  bytes.seal();
  return bytes;
}

/// Returns the number of rejected packets in the sensor's first `turns`; it sends the columns before `window`.
std::size_t refused_of(const Metadata& known, const Metadata& sensor, std::size_t turns, std::size_t window) {
  Decoder decoder{known};
  LidarPacket packet;
  std::size_t refused = 0, of_model = 0;
  const std::size_t turn = sensor.columns_per_frame;
  const double column_ns = 1e9 / (sensor.frames_per_s * static_cast<double>(turn));
  for (std::size_t column = 0; column < turns * turn; column += 16) {
    if (column % turn >= window)
      continue;
    const auto time_ns = 1'000'000'000 + static_cast<std::uint64_t>(static_cast<double>(column) * column_ns);
    const auto frame_id = static_cast<std::uint32_t>(65'535 + column / turn);
    const auto error = decoder.decode(restarted(sensor, column % turn, time_ns, frame_id).payload(), packet);
    EXPECT_TRUE(!error || *error == PacketError::model || column % turn + 16 > known.columns_per_frame);
    refused += error ? 1U : 0U;
    of_model += error == PacketError::model ? 1U : 0U;
  }
  const bool is_followed = refused < turns * window / 16;
  EXPECT_EQ(decoder.packets_of_other_start(), is_followed ? 0 : of_model);
  return refused;
}

/// A restarted sensor is accepted if it still is in the mode of the metadata, and only then.
TEST(OusterDecoder, AcceptsAnotherStartOnceATurnConfirmsItsMode) {
  for (const Mode known : kModes) {
    for (const Mode mode : kModes) {
      const bool is_same = known.columns == mode.columns && known.frames_per_s == mode.frames_per_s;
      for (const std::size_t window : {mode.columns, std::size_t{400}, std::size_t{16}}) {
        const std::size_t of_a_turn = window / 16;
        EXPECT_EQ(refused_of(metadata_of(known), metadata_of(mode), 5, window), is_same ? of_a_turn : 5 * of_a_turn)
            << mode.columns << 'x' << mode.frames_per_s << " read as " << known.columns << 'x' << known.frames_per_s
            << ", a window of " << window;
      }
    }
  }
}

/// After a restart, two turns without a valid packet indicate another mode; a valid one rules it out.
TEST(OusterDecoder, RejectsAnotherStartInAnotherMode) {
  const Metadata known = metadata_of({1024, 10});
  LidarPacket packet;
  const auto play = [&](Decoder& decoder, Mode mode, std::size_t packets) {
    const std::uint64_t packet_ns = 16'000'000'000 / (mode.columns * static_cast<std::size_t>(mode.frames_per_s));
    for (std::size_t i = 0; i < packets; ++i)
      decoder.decode(restarted(metadata_of(mode), 16 * i % mode.columns, 1'000'000'000 + i * packet_ns,
                               static_cast<std::uint32_t>(16 * i / mode.columns))
                         .payload(),
                     packet);
  };
  Decoder same{known}, other{known};
  play(same, {1024, 10}, 64);
  EXPECT_EQ(same.packets_of_other_start(), 64U);
  EXPECT_FALSE(same.is_in_other_mode()) << "it was started anew, no more";
  play(other, {1024, 20}, 128);
  EXPECT_FALSE(other.is_in_other_mode());
  play(other, {1024, 20}, 1);
  EXPECT_TRUE(other.is_in_other_mode());
  ASSERT_EQ(other.decode(OusterTestPacket{known}.payload(), packet), std::nullopt);
  EXPECT_FALSE(other.is_in_other_mode());
  EXPECT_EQ(other.packets_of_other_start(), 0U);
}

/// A clock step in mid-turn must not discard the evidence of that turn.
TEST(OusterDecoder, TurnWithIdsOfAnotherModeConfirmsNothing) {
  const Metadata known = metadata_of({1024, 20}), sensor = metadata_of({2048, 10});
  constexpr std::uint64_t kStart_ns = 1'000'000'000, kPacket_ns = 16 * 48'828;
  Decoder decoder{known};
  LidarPacket packet;
  const auto error = [&](std::size_t column, std::uint64_t time_ns, std::uint32_t frame_id) {
    return decoder.decode(restarted(sensor, column, time_ns, frame_id).payload(), packet);
  };
  EXPECT_EQ(error(1008, kStart_ns, 7), PacketError::model);
  EXPECT_EQ(error(1024, kStart_ns + kPacket_ns, 7), PacketError::azimuth);
  EXPECT_EQ(error(0, kStart_ns + kPacket_ns, 8), PacketError::model);
}

TEST(OusterDecoder, RejectedPacketLeavesItUnchanged) {
  const Metadata metadata = ouster_metadata();
  Decoder decoder{metadata};
  LidarPacket packet;
  ASSERT_EQ(decoder.decode(OusterTestPacket{metadata, 32, 7'000'000}.payload(), packet), std::nullopt);
  OusterTestPacket bad{metadata, 64, 9'000'000};
  bad.set_measurement_id(9, 9);
  bad.set_valid(3, false);
  bad.seal();
  ASSERT_EQ(decoder.decode(bad.payload(), packet), PacketError::azimuth);
  EXPECT_EQ(decoder.time().count(), 7'000'000);
  EXPECT_EQ(decoder.first_column(), 32U);
  EXPECT_EQ(decoder.invalid_columns(), 0U);
}

TEST(OusterDecoder, AnyBytesOfTheRightLengthAreSurvived) {
  std::mt19937_64 random(7);
  for (const Profile profile : kAll) {
    const Metadata metadata = ouster_metadata(profile);
    Decoder decoder{metadata};
    LidarPacket packet;
    std::vector<std::byte> bytes(metadata.packet_format().packet_bytes);
    for (int n = 0; n < 200; ++n) {
      for (std::byte& byte : bytes)
        byte = static_cast<std::byte>(random());
      decoder.decode(bytes, packet);
    }
    OusterTestPacket good{metadata};
    for (int n = 0; n < 2000; ++n) {
      OusterTestPacket flipped = good;
      const std::size_t at = random() % good.payload().size();
      flipped.put(at, std::to_integer<unsigned>(good.payload()[at]) ^ (1U << random() % 8), 1);
      if (decoder.decode(flipped.payload(), packet))
        continue;
      for (const LidarReturn& one : test::returns_of(packet))
        ASSERT_TRUE(std::isfinite(one.x_m + one.y_m + one.z_m) && one.range_m > 0.0F && one.range_m < 1100.0F);
    }
  }
}

TEST(OusterDecoder, GivesTheSameOnEveryInstructionSetToAMillimetre) {
  const Metadata metadata = ouster_metadata(Profile::rng19_dual, 64);
  OusterTestPacket bytes{metadata, 100};
  for (std::size_t i = 0; i < 16; ++i)
    for (std::size_t pixel = 0; pixel < 64; ++pixel)
      bytes.set_return(i, pixel, static_cast<std::uint32_t>(1000 + 777 * pixel + i), 3, pixel % 2);
  bytes.seal();
  Decoder plain{metadata, Isa::baseline};
  LidarPacket expected;
  ASSERT_EQ(plain.decode(bytes.payload(), expected), std::nullopt);
  const auto expected_returns = test::returns_of(expected);
  for (const Isa isa : {Isa::avx2, Isa::avx512}) {
    if (!is_supported(isa))
      continue;
    Decoder decoder{metadata, isa};
    LidarPacket packet;
    ASSERT_EQ(decoder.decode(bytes.payload(), packet), std::nullopt);
    const auto returns = test::returns_of(packet);
    ASSERT_EQ(returns.size(), expected_returns.size());
    for (std::size_t n = 0; n < returns.size(); ++n) {
      EXPECT_NEAR(returns[n].x_m, expected_returns[n].x_m, 1e-4F);
      EXPECT_NEAR(returns[n].y_m, expected_returns[n].y_m, 1e-4F);
      EXPECT_NEAR(returns[n].z_m, expected_returns[n].z_m, 1e-4F);
      EXPECT_EQ(returns[n].range_m, expected_returns[n].range_m);
    }
  }
}

} // namespace
} // namespace locus::ouster

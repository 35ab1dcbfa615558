// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/synthetic_lidar.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <variant>

#include "drivers/hesai/decoder.hpp"
#include "drivers/ouster/decoder.hpp"
#include "drivers/velodyne/decoder.hpp"
#include "locus_sim/ouster_sensor.hpp"
#include "support/returns.hpp"
#include "support/scenes.hpp"

namespace locus::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using velodyne::Model;
using velodyne::ReturnMode;

const Pose kTilted{from_rpy_rad({0.1, 0.3, -0.7}), {0.2, -0.1, 0.9}};

/// Spins at up to 8 rad/s while it drives at 1 m/s on rough ground: four times the robots' rates, so that simulator
/// errors exceed the resolution of range and azimuth.
Trajectory lively_trajectory() {
  return Trajectory(Course{}.change_speed(1, milliseconds{200}).turn(4, 8.0), {},
                    {.height_m = 0.03, .tilt_rad = 0.03, .wavelength_m = 1});
}

std::vector<std::byte> bytes_of(SyntheticLidar lidar, int packets) {
  std::vector<std::byte> bytes;
  for (int i = 0; i < packets; ++i) {
    const Datagram datagram = lidar.next();
    bytes.insert(bytes.end(), datagram.payload.begin(), datagram.payload.end());
  }
  return bytes;
}

std::uint32_t little_endian(std::span<const std::byte> bytes, std::size_t offset, std::size_t count) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < count; ++i)
    value |= std::to_integer<std::uint32_t>(bytes[offset + i]) << (8 * i);
  return value;
}

std::uint32_t ticks(std::span<const std::byte> packet, std::size_t block, std::size_t channel) {
  return little_endian(packet, block * velodyne::kBlockBytes + 4 + 3 * channel, 2);
}

struct Sensor {
  LidarModel model;
  ReturnMode mode;
  double packets_per_s; ///< by its manual
};

/// The decoder of the sensor's maker.
class AnyDecoder {
 public:
  AnyDecoder(const SyntheticLidarOptions& options, Stamp start) {
    if (is_ouster(options.model))
      decoder_.emplace<ouster::Decoder>(OusterSensor(options, start).metadata());
    else if (const auto* const velodyne = std::get_if<Model>(&options.model))
      decoder_.emplace<velodyne::Decoder>(velodyne::DecoderOptions{.model = *velodyne});
  }

  bool reads(const Datagram& datagram, LidarPacket& packet) {
    return std::visit([&](auto& decoder) { return !decoder.decode(datagram.payload, packet); }, decoder_);
  }

 private:
  std::variant<hesai::Decoder, velodyne::Decoder, ouster::Decoder> decoder_{hesai::Decoder{}};
};

class EverySensor : public testing::TestWithParam<Sensor> {};

std::string name_of(const testing::TestParamInfo<Sensor>& test) {
  const LidarModel& model = test.param.model;
  std::string name = is_ouster(model) ? "OS1" : std::holds_alternative<Model>(model) ? "" : "XT32";
  if (const auto* const velodyne = std::get_if<Model>(&model))
    name = to_string(*velodyne);
  name += "_" + std::string(to_string(test.param.mode));
  std::erase(name, '-');
  return name;
}

INSTANTIATE_TEST_SUITE_P(All, EverySensor,
                         testing::Values(Sensor{Model::vlp16, ReturnMode::strongest, 753.5},
                                         Sensor{Model::vlp16, ReturnMode::last, 753.5},
                                         Sensor{Model::vlp16, ReturnMode::dual, 1507.0},
                                         Sensor{Model::puck_hi_res, ReturnMode::strongest, 753.5},
                                         Sensor{Model::vlp32c, ReturnMode::strongest, 1507.0},
                                         Sensor{Model::vlp32c, ReturnMode::dual, 3014.1},
                                         Sensor{Model::hdl32e, ReturnMode::strongest, 1808.4},
                                         Sensor{Model::hdl32e, ReturnMode::dual, 3616.9},
                                         Sensor{Model::vls128, ReturnMode::strongest, 6253.9},
                                         Sensor{Model::vls128, ReturnMode::dual, 18761.7},
                                         Sensor{OusterModel::os1_32, ReturnMode::strongest, 640.0},
                                         Sensor{hesai::Model::xt32, ReturnMode::strongest, 2500.0}),
                         name_of);

/// Full chain: a decoded return, transformed by the lidar's pose at its firing, lies on a surface, up to the resolution
/// of range (half a step) and azimuth (0.01 degrees) and, for an edge with two echoes, the beam width. A single pose
/// per column would cause an error of 5 mm; a common origin of an Ouster's beams, 16 mm.
TEST_P(EverySensor, EveryReturnLiesOnASurfaceAtItsFiringTime) {
  const auto [model, mode] = std::pair{GetParam().model, GetParam().mode};
  const Scene scene = room();
  const Trajectory trajectory = lively_trajectory();
  const SyntheticLidarOptions options{.model = model, .return_mode = mode, .rpm = 1137, .T_base_lidar = kTilted};
  SyntheticLidar lidar(scene, trajectory, options);
  AnyDecoder decoder(options, trajectory.start());
  const FiringPattern& pattern = lidar.pattern();
  const Duration spans = static_cast<Duration::rep>(pattern.columns) * pattern.column_duration;
  const Duration to_first_firing = std::ranges::min(pattern.firings, {}, &FiringPattern::Firing::after).after;
  const auto packet = std::make_unique<LidarPacket>();
  const double half_step_m = pattern.resolution_m / 2;
  const double aside_rad = 0.01 * kRadPerDeg + (mode == ReturnMode::dual ? kHalfBeam_rad : 0);
  std::size_t packets = 0, returns = 0;
  ASSERT_TRUE(decoder.reads(lidar.next(), *packet)); // the decoder needs two columns to measure the rotation
  for (Datagram datagram = lidar.next(); datagram.receive_stamp < trajectory.end(); datagram = lidar.next()) {
    ASSERT_TRUE(decoder.reads(datagram, *packet));
    const Stamp fired = datagram.receive_stamp - spans + to_first_firing;
    const std::vector<LidarReturn> echoes = test::returns_of(*packet);
    for (const LidarReturn& echo : echoes) {
      const auto range_m = static_cast<double>(echo.range_m);
      const Pose T_world_lidar = trajectory.T_world_base(fired + Duration{echo.offset_ns}) * kTilted;
      const Eigen::Vector3d point = T_world_lidar * Eigen::Vector3f{echo.x_m, echo.y_m, echo.z_m}.cast<double>();
      ASSERT_LT(scene.distance_to_surface(point), half_step_m + aside_rad * range_m + 1e-5)
          << "packet " << packets << " ring " << int{echo.ring} << " range " << range_m;
    }
    ++packets;
    returns += echoes.size();
  }
  const std::size_t firings = packets * pattern.columns * pattern.firings.size();
  EXPECT_GT(packets, 500U);
  EXPECT_GE(static_cast<double>(returns), 0.99 * static_cast<double>(firings)); // the room is closed
}

TEST_P(EverySensor, PacketRateIsThatOfTheManual) {
  const Sensor& sensor = GetParam();
  const Scene nothing({});
  const Trajectory trajectory(Course{}.stand(seconds{1}));
  SyntheticLidar lidar(nothing, trajectory, {.model = sensor.model, .return_mode = sensor.mode});
  int packets = 0;
  while (lidar.next().receive_stamp <= trajectory.end())
    ++packets;
  EXPECT_NEAR(packets, sensor.packets_per_s, 1);
}

TEST(SyntheticLidar, PacketHoldsTimeModeAndModel) {
  const Scene scene = room();
  const Trajectory trajectory(Course{}.stand(seconds{1}),
                              {.stamp = stamp_from_ns(3600'000'000'000 * 7 + 1'234'567'999)});
  SyntheticLidar lidar(scene, trajectory, {.model = Model::hdl32e, .return_mode = ReturnMode::last});
  const Datagram datagram = lidar.next();
  ASSERT_EQ(datagram.payload.size(), velodyne::kDataPacketBytes);
  EXPECT_EQ(little_endian(datagram.payload, 0, 2), 0xEEFFU);
  EXPECT_EQ(little_endian(datagram.payload, 1200, 4), 1'234'567U);
  EXPECT_EQ(little_endian(datagram.payload, 1204, 2), 0x2138U);
  EXPECT_EQ(datagram.destination_port, 2368);
}

TEST(SyntheticLidar, TimeWrapsAtTheHour) {
  const Scene scene = room();
  const Trajectory trajectory(Course{}.stand(seconds{1}), {.stamp = stamp_from_ns(3600'000'000'000 * 7 - 1'000'000)});
  SyntheticLidar lidar(scene, trajectory, {});
  EXPECT_EQ(little_endian(lidar.next().payload, 1200, 4), 3'599'999'000U);
  EXPECT_EQ(little_endian(lidar.next().payload, 1200, 4), 327U); // 1327.1 us later
}

TEST(SyntheticLidar, AzimuthFollowsTheRotor) {
  const Scene scene = room();
  const Trajectory trajectory(Course{}.stand(seconds{1}));
  SyntheticLidar lidar(scene, trajectory, {.rpm = 1200, .first_azimuth_deg = 350});
  const Datagram datagram = lidar.next();
  const auto azimuth_cdeg = [&](std::size_t block) { return little_endian(datagram.payload, 100 * block + 2, 2); };
  EXPECT_EQ(azimuth_cdeg(0), 35'000U);
  EXPECT_EQ(azimuth_cdeg(11), 35'876U); // 11 columns of 110.592 us at 7.2 deg/ms
}

TEST(SyntheticLidar, SameSeedSameBytes) {
  const Scene scene = room();
  const Trajectory trajectory = lively_trajectory();
  SyntheticLidarOptions options{.range_noise_m = 0.02, .dropout = 0.1, .sends_position_packets = true, .seed = 5};
  const std::vector<std::byte> bytes = bytes_of({scene, trajectory, options}, 200);
  EXPECT_EQ(bytes, bytes_of({scene, trajectory, options}, 200));
  options.seed = 6;
  EXPECT_NE(bytes, bytes_of({scene, trajectory, options}, 200));
}

TEST(SyntheticLidar, NoiseAndDropoutsAreAsConfigured) {
  const Scene scene = room();
  const Trajectory trajectory(Course{}.stand(seconds{1}), {}, {});
  const Pose T_base_lidar{Eigen::Quaterniond::Identity(), {0, 0, 1}};
  SyntheticLidar perfect(scene, trajectory, {.T_base_lidar = T_base_lidar});
  SyntheticLidar faulty(scene, trajectory, {.T_base_lidar = T_base_lidar, .range_noise_m = 0.02, .dropout = 0.1});
  double sum = 0, lost = 0, kept = 0;
  for (int packet = 0; packet < 200; ++packet) {
    const Datagram clean = perfect.next(), noisy = faulty.next();
    for (std::size_t block = 0; block < velodyne::kBlocks; ++block)
      for (std::size_t channel = 0; channel < velodyne::kChannels; ++channel) {
        const double there = ticks(clean.payload, block, channel), seen = ticks(noisy.payload, block, channel);
        ASSERT_GT(there, 0);
        (seen == 0 ? lost : kept) += 1;
        sum += seen == 0 ? 0 : std::pow(0.002 * (seen - there), 2);
      }
  }
  EXPECT_NEAR(std::sqrt(sum / kept), 0.02, 0.0004);
  EXPECT_NEAR(lost / (lost + kept), 0.1, 0.005);
}

TEST(SyntheticLidar, DustReturnsTheConfiguredShareAndDualModeSeesThroughIt) {
  const Scene wall({{Rectangle{{20, -200, -200}, {0, 400, 0}, {0, 0, 400}}}});
  const Trajectory trajectory(Course{}.stand(seconds{1}));
  SyntheticLidar lidar(wall, trajectory, {.return_mode = ReturnMode::dual, .dust = 0.2});
  double dusty = 0, all = 0;
  for (int packet = 0; packet < 15; ++packet) { // a tenth of a turn, past the wall
    const Datagram datagram = lidar.next();
    for (std::size_t block = 0; block < velodyne::kBlocks; block += 2)
      for (std::size_t channel = 0; channel < velodyne::kChannels; ++channel) {
        const std::uint32_t last = ticks(datagram.payload, block, channel);
        const std::uint32_t strongest = ticks(datagram.payload, block + 1, channel);
        ASSERT_GE(last, 10'000U); // 20 m
        dusty += strongest < last;
        ++all;
      }
  }
  EXPECT_NEAR(dusty / all, 0.2, 0.03);
}

TEST(SyntheticLidar, DarkSurfacesFadeWithDistance) {
  const Trajectory trajectory(Course{}.stand(seconds{1}));
  const auto seen_of = [&](double x_m, std::uint8_t reflectivity) { // a wall ahead
    const Scene wall({{Rectangle{{x_m, -200, -200}, {0, 400, 0}, {0, 0, 400}}, reflectivity}});
    SyntheticLidar lidar(wall, trajectory, {.fades = true});
    const Datagram datagram = lidar.next();
    int seen = 0;
    for (std::size_t channel = 0; channel < velodyne::kChannels; ++channel)
      seen += ticks(datagram.payload, 0, channel) > 0;
    return seen;
  };
  EXPECT_EQ(seen_of(30, 50), 32);
  EXPECT_EQ(seen_of(30, 10), 32);
  EXPECT_EQ(seen_of(80, 50), 32);
  EXPECT_EQ(seen_of(80, 10), 0);
}

TEST(SyntheticLidar, NothingIsReturnedBeyondTheMaximumRange) {
  const Scene scene = room();
  const Trajectory trajectory(Course{}.stand(seconds{1}));
  SyntheticLidar lidar(scene, trajectory,
                       {.T_base_lidar = {Eigen::Quaterniond::Identity(), {0, 0, 1}}, .max_range_m = 4.5});
  std::size_t seen = 0, unseen = 0;
  for (int packet = 0; packet < 76; ++packet) {
    const Datagram datagram = lidar.next();
    for (std::size_t channel = 0; channel < velodyne::kChannels; ++channel) {
      const std::uint32_t range = ticks(datagram.payload, 0, channel);
      ASSERT_LE(range, 2250U);
      ++(range == 0 ? unseen : seen);
    }
  }
  EXPECT_GT(seen, 100U);
  EXPECT_GT(unseen, 100U);
}

TEST(SyntheticLidar, EdgesHaveTwoEchoesInDualReturnMode) {
  const Scene scene = street(50);
  const Trajectory trajectory(Course{}.stand(seconds{1}));
  SyntheticLidar lidar(
      scene, trajectory,
      {.return_mode = ReturnMode::dual, .T_base_lidar = {Eigen::Quaterniond::Identity(), {0, 0, 1.8}}});
  int pairs = 0;
  for (int packet = 0; packet < 150; ++packet) {
    const Datagram datagram = lidar.next();
    for (std::size_t block = 0; block < velodyne::kBlocks; block += 2)
      for (std::size_t channel = 0; channel < velodyne::kChannels; ++channel) {
        const std::uint32_t last = ticks(datagram.payload, block, channel);
        const std::uint32_t strongest = ticks(datagram.payload, block + 1, channel);
        ASSERT_GE(last, strongest);
        pairs += last > strongest;
      }
  }
  EXPECT_GT(pairs, 20);
}

TEST(SyntheticLidar, EverySixthPacketIsAPositionPacketIfEnabled) {
  const Scene scene = room();
  const Trajectory trajectory(Course{}.stand(seconds{1})); // 2023-11-14 22:13:20
  SyntheticLidar lidar(scene, trajectory, {.clock_offset = seconds{2}, .sends_position_packets = true});
  for (int packet = 0; packet < 5; ++packet)
    ASSERT_EQ(lidar.next().payload.size(), velodyne::kDataPacketBytes);
  const Datagram datagram = lidar.next();
  ASSERT_EQ(datagram.payload.size(), kPositionPacketBytes);
  EXPECT_EQ(datagram.destination_port, 8308);
  EXPECT_EQ(little_endian(datagram.payload, 198, 4), (13U * 60 + 22) * 1'000'000 + 6'635); // five packets later
  EXPECT_EQ(little_endian(datagram.payload, 202, 1), 2U);
  std::string sentence;
  for (std::size_t i = 206; datagram.payload[i] != std::byte{0}; ++i)
    sentence.push_back(std::to_integer<char>(datagram.payload[i]));
  EXPECT_EQ(sentence.substr(0, 15), "$GPRMC,221322,A");
  EXPECT_EQ(sentence.substr(sentence.size() - 2), "\r\n");
}

} // namespace
} // namespace locus::sim

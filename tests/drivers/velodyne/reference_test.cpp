// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "drivers/files/capture.hpp"
#include "drivers/lidar_router.hpp"
#include "drivers/reference_data.hpp"
#include "drivers/velodyne/decoder.hpp"
#include "drivers/wire.hpp"
#include "support/returns.hpp"
#include "support/test_data.hpp"

namespace locus {
namespace {

using velodyne::Decoder;
using velodyne::Model;
using velodyne::ReturnMode;

std::filesystem::path velodyne_data(const std::string& name) { return test::test_data() / "velodyne" / name; }

#define SKIP_WITHOUT(file)                                                                                             \
  if (!std::filesystem::exists(file))                                                                                  \
  GTEST_SKIP() << (file) << " is not there; LOCUS_TEST_DATA names the folder of the real captures"

std::uint16_t azimuth_of_block(std::span<const std::byte> payload, std::size_t block) {
  return read_u16(payload.data() + block * velodyne::kBlockBytes + 2);
}

/// Returns the number of returns between wraps of the block azimuth, with the incomplete first and last frame.
std::vector<int> returns_per_frame(const std::filesystem::path& file, Decoder& decoder) {
  auto capture = Capture::open(file);
  EXPECT_TRUE(capture.has_value());
  LidarPacket packet;
  std::vector<int> frames{0};
  int last_azimuth_cdeg = -1;
  while (const Datagram* datagram = capture->next()) {
    if (datagram->payload.size() != velodyne::kDataPacketBytes)
      continue;
    EXPECT_EQ(decoder.decode(datagram->payload, packet), std::nullopt);
    const auto column_ns = velodyne::spec(*decoder.model()).column_duration.count();
    const std::vector<LidarReturn> returns = test::returns_of(packet);
    std::size_t next = 0;
    for (std::size_t block = 0; block < velodyne::kBlocks; ++block) {
      if (azimuth_of_block(datagram->payload, block) < last_azimuth_cdeg)
        frames.push_back(0);
      last_azimuth_cdeg = azimuth_of_block(datagram->payload, block);
      for (; next < returns.size() && returns[next].offset_ns / column_ns == static_cast<long>(block); ++next)
        ++frames.back();
    }
    EXPECT_EQ(next, returns.size());
  }
  return frames;
}

TEST(VelodyneReference, Hdl32eReturnsMatchAnIndependentDecoder) {
  const auto file = velodyne_data("hdl32e_static_monterey.pcap");
  SKIP_WITHOUT(file);
  Decoder decoder;
  const std::vector<int> frames = returns_per_frame(file, decoder);
  EXPECT_EQ(decoder.model(), Model::hdl32e);
  EXPECT_EQ(decoder.return_mode(), ReturnMode::strongest);
  ASSERT_EQ(frames.size(), 19U);
  EXPECT_EQ(frames[0], 27649);
  EXPECT_EQ(frames[2], 49485);
  EXPECT_EQ(frames[8], 49737);
  EXPECT_EQ(frames[11], 49778);
  EXPECT_EQ(frames[18], 396);
}

TEST(VelodyneReference, Vlp16WithTheProductIdOfAnHdl32eIsRecognised) {
  const auto file = velodyne_data("vlp16_static_1200rpm_product21.pcap");
  SKIP_WITHOUT(file);
  Decoder decoder;
  const std::vector<int> frames = returns_per_frame(file, decoder);
  EXPECT_EQ(decoder.model(), Model::vlp16);
  ASSERT_EQ(frames.size(), 52U);
  EXPECT_EQ(frames[0], 5736);
  EXPECT_EQ(frames[2], 13898);
  EXPECT_EQ(frames[16], 13860);
  EXPECT_EQ(frames[51], 274);
}

TEST(VelodyneReference, ModelIsRightFromTheFirstPacketOn) {
  const std::vector<std::pair<std::string, Model>> captures{{"vlp16_static_1200rpm_product21.pcap", Model::vlp16},
                                                            {"vlp16_static_gps_pps.pcap", Model::vlp16},
                                                            {"hdl32e_moving_15mps.pcap", Model::hdl32e}};
  for (const auto& [name, model] : captures) {
    SKIP_WITHOUT(velodyne_data(name));
    auto capture = Capture::open(velodyne_data(name));
    ASSERT_TRUE(capture.has_value());
    LidarPacket packet;
    int starts = 0;
    int right_at_once = 0;
    std::optional<Decoder> second_packet_of;
    while (const Datagram* datagram = capture->next()) {
      if (datagram->payload.size() != velodyne::kDataPacketBytes)
        continue;
      if (second_packet_of) {
        ASSERT_EQ(second_packet_of->decode(datagram->payload, packet), std::nullopt);
        EXPECT_EQ(second_packet_of->model(), model) << name << ": the spacing of two packets decides";
      }
      second_packet_of.emplace();
      ASSERT_EQ(second_packet_of->decode(datagram->payload, packet), std::nullopt);
      ++starts;
      right_at_once += second_packet_of->model() == model ? 1 : 0;
    }
    EXPECT_GT(right_at_once, 0.8 * starts) << name << ": a lone packet can only be guessed";
  }
}

// --- Comparison with the point clouds of another decoder -------------------------------------------------------------

struct Point {
  double x_m, y_m, z_m;
  bool is_matched = false;
};

double distance(const Point& a, const Point& b) { return std::hypot(a.x_m - b.x_m, a.y_m - b.y_m, a.z_m - b.z_m); }

/// Index of the returns of one revolution by exactly equal values: ring, distance in ticks and, if known, intensity.
struct Key {
  int ring, ticks, intensity;
  auto operator<=>(const Key&) const = default;
};
using Revolution = std::multimap<Key, Point>;

Point turned_clockwise(const LidarReturn& at, double angle_rad, double lift_m) {
  const double c = std::cos(angle_rad);
  const double s = std::sin(angle_rad);
  const auto x = static_cast<double>(at.x_m);
  const auto y = static_cast<double>(at.y_m);
  return {c * x + s * y, c * y - s * x, static_cast<double>(at.z_m) + lift_m};
}

/// Convention of another decoder for the position of a return: maps the firing time, as a share of the column's
/// duration, to the share of the rotation that it applies; may lack the vertical offsets.
struct Convention {
  double (*share)(std::size_t laser, double own_share, bool is_last_column);
  bool has_vertical_offsets;
};

constexpr double kBlindSectorRad = 0.5; ///< no motor turns so far from one column to the next

/// Decodes concatenated packets and cuts before the first packet past `cut_cdeg`; rotates every point from the
/// decoder's position to that of the convention, by the known rotation of each block and laser.
std::vector<Revolution> decode_to_convention(const std::vector<std::byte>& packets, const Convention& convention,
                                             int cut_cdeg, bool keeps_intensity) {
  Decoder decoder;
  LidarPacket packet;
  std::vector<Revolution> revolutions(1);
  int last_azimuth_cdeg = -1;
  for (std::size_t at = 0; at + velodyne::kDataPacketBytes <= packets.size(); at += velodyne::kDataPacketBytes) {
    const std::span payload{packets.data() + at, velodyne::kDataPacketBytes};
    EXPECT_EQ(decoder.decode(payload, packet), std::nullopt);
    const velodyne::ModelSpec& spec = velodyne::spec(*decoder.model());
    const auto layout = velodyne::packet_layout(*decoder.model(), *decoder.return_mode());
    const auto azimuth = [&](std::size_t column) {
      return azimuth_of_block(payload, column * layout.blocks_per_column());
    };
    const auto turn_rad = [&](std::size_t from, std::size_t to) {
      return (azimuth(to) + 36000 - azimuth(from)) % 36000 * std::numbers::pi / 18000.0;
    };
    const int past_cut_cdeg = (azimuth(0) + 36000 - cut_cdeg) % 36000;
    if (past_cut_cdeg < last_azimuth_cdeg)
      revolutions.emplace_back();
    last_azimuth_cdeg = past_cut_cdeg;

    const std::size_t last_column = layout.columns - 1;
    const auto skipped_columns = static_cast<std::size_t>(packet.duration / spec.column_duration) - layout.columns;
    for (const LidarReturn& r : test::returns_of(packet)) {
      auto column = static_cast<std::size_t>(r.offset_ns / spec.column_duration.count());
      column -= column > last_column ? skipped_columns : 0; // behind a blind sector
      const auto lasers = spec.calibration.lasers();
      const auto laser = static_cast<std::size_t>(
          std::find_if(lasers.begin(), lasers.end(), [&](const auto& l) { return l.ring == r.ring; }) - lasers.begin());
      const double own_share = static_cast<double>(r.offset_ns % spec.column_duration.count()) /
                               static_cast<double>(spec.column_duration.count());
      const double mean_turn = turn_rad(0, last_column) / static_cast<double>(last_column + skipped_columns);
      const double turn = column < last_column ? turn_rad(column, column + 1) : mean_turn;
      const double own_turn = turn < kBlindSectorRad ? turn : mean_turn; // the other rotates through the blind sector
      const double moved_rad = turn * convention.share(laser, own_share, column == last_column) - own_turn * own_share;
      const double lift_m = convention.has_vertical_offsets ? 0.0 : -lasers[laser].vertical_offset_m;
      const int ticks =
          static_cast<int>(std::lround(static_cast<double>(r.range_m) / spec.calibration.distance_resolution_m));
      revolutions.back().emplace(Key{r.ring, ticks, keeps_intensity ? r.intensity : 0},
                                 turned_clockwise(r, moved_rad, lift_m));
    }
  }
  return revolutions;
}

struct Match {
  int points = 0;
  int matched = 0; ///< ring, distance and intensity agree, and the position within 5 mm
};

/// Matches each expected point with a point of the revolution, one to one.
Match match(const std::vector<std::pair<Key, Point>>& expected, Revolution revolution) {
  Match result;
  for (const auto& [key, point] : expected) {
    ++result.points;
    const auto [begin, end] = revolution.equal_range(key);
    for (auto candidate = begin; candidate != end; ++candidate) {
      if (!candidate->second.is_matched && distance(candidate->second, point) <= 0.005) {
        candidate->second.is_matched = true;
        ++result.matched;
        break;
      }
    }
  }
  return result;
}

Match best_match(const std::vector<std::pair<Key, Point>>& expected, const std::vector<Revolution>& revolutions) {
  Match best;
  for (const Revolution& revolution : revolutions) {
    const Match one = match(expected, revolution);
    if (one.matched >= best.matched)
      best = one;
  }
  return best;
}

double manuals_share(std::size_t /*laser*/, double own_share, bool /*is_last_column*/) { return own_share; }

#pragma pack(push, 1)
struct DualPoint {
  float x, y, z;
  std::uint8_t intensity, return_type;
  std::uint16_t channel;
  float azimuth, elevation, distance;
  std::uint32_t time_stamp;
};
struct PlainPoint {
  float x, y, z;
};
#pragma pack(pop)

std::vector<std::pair<Key, Point>> expected_dual_points() {
  std::vector<std::pair<Key, Point>> points;
  for (const DualPoint& p : test::read_binary_pcd<DualPoint>(velodyne_data("vlp16_dual.expected.pcd")))
    points.push_back({{p.channel, static_cast<int>(std::lround(static_cast<double>(p.distance) / 0.002)), p.intensity},
                      {static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)}});
  return points;
}

TEST(VelodyneReference, Vlp16DualReturnsMatchAnotherDecoder) {
  SKIP_WITHOUT(velodyne_data("vlp16_dual.packets.bin"));
  const auto packets = test::read_file(velodyne_data("vlp16_dual.packets.bin"));
  const auto expected = expected_dual_points();
  ASSERT_EQ(expected.size(), 14831U);

  // The other decoder does not interpolate in the last pair of blocks and ignores the manual's vertical corrections.
  const Convention other{[](std::size_t, double own, bool is_last) { return is_last ? 0.0 : own; }, false};
  const Match in_its_conventions = best_match(expected, decode_to_convention(packets, other, 0, true));
  EXPECT_GE(in_its_conventions.matched, 0.99 * in_its_conventions.points);

  const Convention with_offsets{other.share, true};
  const Match with_vertical = best_match(expected, decode_to_convention(packets, with_offsets, 0, true));
  EXPECT_LT(with_vertical.matched, 0.8 * with_vertical.points) << "up to 11.2 mm of vertical correction must show";
}

TEST(VelodyneReference, Vlp32cReturnsMatchAnotherDecoder) {
  SKIP_WITHOUT(velodyne_data("vlp32c_strongest.packets.bin"));
  const auto packets = test::read_file(velodyne_data("vlp32c_strongest.packets.bin"));
  const auto lasers = velodyne::spec(Model::vlp32c).calibration.lasers();
  std::vector<std::pair<Key, Point>> expected;
  for (const PlainPoint& p : test::read_binary_pcd<PlainPoint>(velodyne_data("vlp32c_strongest.expected.pcd"))) {
    const Point point{static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)};
    const double range_m = distance(point, {0.0, 0.0, 0.0});
    const double elevation_rad = std::asin(point.z_m / range_m);
    const auto laser = std::min_element(lasers.begin(), lasers.end(), [&](const auto& a, const auto& b) {
      return std::abs(a.elevation_rad - elevation_rad) < std::abs(b.elevation_rad - elevation_rad);
    });
    expected.push_back({{laser->ring, static_cast<int>(std::lround(range_m / 0.004)), 0}, point});
  }
  ASSERT_EQ(expected.size(), 26216U);

  constexpr int kBlindCdeg = 18000; // field of view from 270 to 91 degrees

  // The other decoder times the lasers individually, not in pairs, and does not interpolate in the last block.
  const Convention other{[](std::size_t laser, double, bool is_last) {
                           return is_last ? 0.0 : 2.304 * static_cast<double>(laser) / 55.296;
                         },
                         true};
  const Match in_its_conventions = best_match(expected, decode_to_convention(packets, other, kBlindCdeg, false));
  EXPECT_EQ(in_its_conventions.matched, in_its_conventions.points);

  const Match by_the_manual =
      best_match(expected, decode_to_convention(packets, {manuals_share, true}, kBlindCdeg, false));
  EXPECT_LT(by_the_manual.matched, by_the_manual.points) << "up to half a column of firing time must show";
}

// --- Complete input: sender, clock, counters, position packets -------------------------------------------------------

struct Replayed {
  PacketCounters counters;
  std::vector<velodyne::PositionPacket> positions;
  std::vector<Stamp> stamps;
  std::vector<Duration> lateness; ///< reception minus the stamp of the last firing
};

Replayed replay(const std::filesystem::path& file, LidarTime time = LidarTime::automatic) {
  LidarOptions options;
  options.time = time;
  auto router = LidarRouter::open({options});
  auto capture = Capture::open(file);
  EXPECT_TRUE(router && capture);
  Replayed result;
  while (const Datagram* datagram = capture->next()) {
    if (const LidarPacket* packet = router->receive(*datagram)) {
      result.stamps.push_back(packet->stamp);
      result.lateness.push_back(datagram->receive_stamp - packet->stamp - packet->duration);
    } else if (const auto& position = router->lidars().front().position()) {
      result.positions.push_back(*position);
    }
  }
  result.counters = router->total();
  return result;
}

PacketCounters good_packets(std::uint64_t data, std::uint64_t position) {
  PacketCounters counters;
  counters.received = data + position;
  counters.data = data;
  counters.position = position;
  return counters;
}

TEST(VelodyneReference, EveryPacketOfTheCapturesIsAcceptedAndCounted) {
  SKIP_WITHOUT(velodyne_data("hdl32e_moving_15mps.pcap"));
  EXPECT_EQ(replay(velodyne_data("hdl32e_moving_15mps.pcap")).counters, good_packets(876, 100));
  EXPECT_EQ(replay(velodyne_data("hdl32e_static_monterey.pcap")).counters, good_packets(2702, 299));
  EXPECT_EQ(replay(velodyne_data("vlp16_static_1200rpm_product21.pcap")).counters, good_packets(1902, 367));
  EXPECT_EQ(replay(velodyne_data("vlp16_static_gps_pps.pcap")).counters, good_packets(293, 57));
}

TEST(VelodyneReference, CarDrivesAtTheSpeedItsGpsReports) {
  SKIP_WITHOUT(velodyne_data("hdl32e_moving_15mps.pcap"));
  const Replayed car = replay(velodyne_data("hdl32e_moving_15mps.pcap"));
  ASSERT_EQ(car.positions.size(), 100U);
  constexpr double kMpsPerKnot = 1852.0 / 3600.0;
  for (const auto& position : car.positions) {
    ASSERT_TRUE(position.rmc && position.rmc->valid);
    ASSERT_TRUE(position.rmc->speed_mps && position.rmc->course_deg);
    EXPECT_GE(*position.rmc->speed_mps, 28.8 * kMpsPerKnot - 1e-9);
    EXPECT_LE(*position.rmc->speed_mps, 29.5 * kMpsPerKnot + 1e-9);
    EXPECT_GE(*position.rmc->course_deg, 158.3);
    EXPECT_LE(*position.rmc->course_deg, 159.8);
    using namespace std::chrono;
    EXPECT_EQ(position.rmc->date, (2012y / December / 11d));
    EXPECT_FALSE(position.is_synchronised()) << "this firmware does not know PPS";
  }
}

TEST(VelodyneReference, Vlp16WithReceiverIsLockedToPps) {
  SKIP_WITHOUT(velodyne_data("vlp16_static_gps_pps.pcap"));
  for (const auto& position : replay(velodyne_data("vlp16_static_gps_pps.pcap")).positions)
    EXPECT_TRUE(position.is_synchronised());
}

TEST(VelodyneReference, ReceptionStampsAreWithinOneAndAHalfMilliseconds) {
  SKIP_WITHOUT(velodyne_data("vlp16_static_gps_pps.pcap"));
  for (const char* name : {"hdl32e_moving_15mps.pcap", "hdl32e_static_monterey.pcap", "vlp16_static_gps_pps.pcap",
                           "vlp16_static_1200rpm_product21.pcap"}) {
    const Replayed capture = replay(velodyne_data(name), LidarTime::receive);
    for (const Duration lateness : capture.lateness)
      EXPECT_LT(std::chrono::abs(lateness), std::chrono::microseconds{1500}) << name;
  }
}

TEST(VelodyneReference, SensorTimeIsUsedUnchanged) {
  SKIP_WITHOUT(velodyne_data("vlp16_static_gps_pps.pcap"));
  const Replayed capture = replay(velodyne_data("vlp16_static_gps_pps.pcap"), LidarTime::sensor);
  ASSERT_FALSE(capture.stamps.empty());
  // The first packet contains 1082.340595 s past the hour; it was captured on 2016-01-21 at 08:18:02 UTC.
  EXPECT_EQ(to_ns(capture.stamps.front()), (1'453'363'200 + 1082) * 1'000'000'000LL + 340'595'000);
}

} // namespace
} // namespace locus

// SPDX-License-Identifier: Apache-2.0
#include "drivers/clouds/cloud_decoder.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "support/clouds.hpp"
#include "support/returns.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using Type = CloudView::Type;

constexpr Stamp kBegin = stamp_from_ns(1'700'000'000'000'000'000);
constexpr Duration kTurn = milliseconds{100};
constexpr Duration kWay = milliseconds{4};
constexpr Duration kInstant = std::chrono::microseconds{50}; ///< span of a cloud of one instant
constexpr std::size_t kColumns = 1800, kRings = 16;

/// A turn in a round room of 5 m, clockwise from the rear as real lidars rotate, with rings two degrees apart.
CloudTurn round_room(Stamp begin = kBegin) {
  CloudTurn turn{begin, {}};
  for (std::size_t column = 0; column < kColumns; ++column) {
    for (std::size_t ring = 0; ring < kRings; ++ring) {
      const double share = (static_cast<double>(column) + static_cast<double>(ring) / 32) / kColumns;
      const double azimuth = std::numbers::pi - 2 * std::numbers::pi * share;
      const double elevation = (2.0 * static_cast<double>(ring) - 15) * std::numbers::pi / 180;
      const Eigen::Vector3d p{5 * std::cos(azimuth), 5 * std::sin(azimuth), 5 * std::tan(elevation)};
      turn.points.push_back(
          {p.cast<float>(), static_cast<std::uint8_t>(ring), 42, begin + from_seconds(share * to_seconds(kTurn))});
    }
  }
  return turn;
}

std::unique_ptr<CloudDecoder> decoder(PointTimesFrom times = PointTimesFrom::automatic) {
  return std::make_unique<CloudDecoder>(std::uint8_t{0}, times);
}

std::optional<CloudError> begin(CloudDecoder& decoder, const OwnCloud& cloud, Stamp arrival = kBegin + kTurn + kWay) {
  return decoder.begin(cloud.view(), arrival);
}

struct Fired {
  Stamp stamp;
  LidarReturn what;
};

/// Returns all returns; checks the invariants of LidarPacket.
std::vector<Fired> drain(CloudDecoder& decoder) {
  std::vector<Fired> all;
  std::optional<LidarPacket::Cloud> cloud;
  Stamp last{};
  while (const LidarPacket* packet = decoder.next()) {
    EXPECT_FALSE(cloud && cloud->ends_here);
    cloud = packet->cloud;
    EXPECT_TRUE(cloud.has_value());
    EXPECT_LE(packet->count, LidarPacket::kMaxFiringGroups);
    EXPECT_GT(packet->duration, Duration{});
    EXPECT_LE(packet->stamp + packet->duration, cloud->end);
    EXPECT_GE(packet->stamp, last) << "in the order of time";
    last = packet->stamp;
    EXPECT_LT(packet->first_azimuth_cdeg, 36000);
    for (const LidarReturn& r : returns_of(*packet)) {
      EXPECT_LT(r.offset_ns, packet->duration.count());
      all.push_back({packet->stamp + Duration{r.offset_ns}, r});
    }
  }
  EXPECT_TRUE(!cloud || cloud->ends_here);
  return all;
}

/// Expects each return of the turn once, with its time to 1 us and its ring.
void expect_all_of(const CloudTurn& turn, std::vector<Fired> fired) {
  ASSERT_EQ(fired.size(), turn.points.size());
  const auto key = [](Stamp stamp, int ring) { return std::pair{ring, stamp}; };
  std::ranges::sort(fired, {}, [&](const Fired& f) { return key(f.stamp, f.what.ring); });
  std::vector<FiredPoint> points = turn.points;
  std::ranges::sort(points, {}, [&](const FiredPoint& p) { return key(p.fired, p.ring); });
  for (std::size_t i = 0; i < points.size(); ++i) {
    ASSERT_EQ(fired[i].what.ring, points[i].ring) << i;
    ASSERT_LT(std::abs(to_seconds(fired[i].stamp - points[i].fired)), 1e-6) << i;
    ASSERT_EQ(fired[i].what.x_m, points[i].p_m.x()) << i;
    ASSERT_NEAR(fired[i].what.range_m, points[i].p_m.norm(), 1e-5) << i;
  }
}

/// Returns the first columns of a turn of a lidar with 128 lasers.
CloudTurn many_lasers(std::size_t columns, Stamp begin = kBegin) {
  CloudTurn turn{begin, {}};
  for (std::size_t column = 0; column < columns; ++column)
    for (std::size_t ring = 0; ring < 128; ++ring) {
      const double azimuth = 2 * std::numbers::pi * static_cast<double>(column) / 1024,
                   elevation = 0.006 * static_cast<double>(ring);
      turn.points.push_back(
          {Eigen::Vector3d{5 * std::cos(azimuth), -5 * std::sin(azimuth), 5 * std::tan(elevation)}.cast<float>(),
           static_cast<std::uint8_t>(ring), 1, begin + Duration{97'000 * static_cast<Duration::rep>(column)}});
    }
  return turn;
}

/// Returns a cloud with point times relative to the header's stamp, in this unit.
OwnCloud timed_in(double unit_s, const CloudTurn& turn) {
  OwnCloud cloud = cloud_of(turn, CloudKind::bare);
  add_field(cloud, "ring", Type::uint16);
  add_field(cloud, "t", Type::float64);
  for (std::size_t i = 0; i < turn.points.size(); ++i) {
    cloud.set(i, "ring", std::uint16_t{turn.points[i].ring});
    cloud.set(i, "t", to_seconds(turn.points[i].fired - turn.begin) / unit_s);
  }
  return cloud;
}

bool has(const CloudDecoder& decoder, CloudDoubt doubt) { return decoder.doubts()[static_cast<std::size_t>(doubt)]; }

class DecoderOf : public testing::TestWithParam<int> {};

TEST_P(DecoderOf, GivesEveryReturnAtItsTimeWithItsRing) {
  const auto kind = static_cast<CloudKind>(GetParam());
  const auto tested = decoder();
  for (int k = 0; k < 3; ++k) {
    const CloudTurn turn = round_room(kBegin + k * kTurn);
    ASSERT_EQ(begin(*tested, cloud_of(turn, kind), turn.begin + kTurn + kWay), std::nullopt);
    expect_all_of(turn, drain(*tested));
  }
  EXPECT_EQ(tested->timing(), kind == CloudKind::bare ? PointTiming::azimuth : PointTiming::field);
  EXPECT_EQ(tested->rings(), kind == CloudKind::bare ? RingsFrom::elevation : RingsFrom::field);
  EXPECT_EQ(tested->period(), kTurn);
}

INSTANTIATE_TEST_SUITE_P(Kinds, DecoderOf, testing::Range(0, kCloudKinds),
                         [](const auto& tested) { return name_of(static_cast<CloudKind>(tested.param)); });

TEST(CloudDecoder, FieldsMayHaveAnyOrderAndPadding) {
  OwnCloud cloud;
  cloud.stamp = kBegin;
  cloud.fields = {{"label", 1, Type::uint8}, {"time", 3, Type::float32}, {"z", 11, Type::float64},
                  {"ring", 20, Type::uint8}, {"x", 23, Type::float32},   {"y", 29, Type::float32},
                  {"rgb", 35, Type::uint32}};
  cloud.point_step = 41;
  const CloudTurn turn = round_room();
  cloud.width = static_cast<std::uint32_t>(turn.points.size());
  cloud.data.assign(turn.points.size() * cloud.point_step, std::byte{0x5a});
  for (std::size_t i = 0; i < turn.points.size(); ++i) {
    const FiredPoint& p = turn.points[i];
    cloud.set(i, "x", p.p_m.x());
    cloud.set(i, "y", p.p_m.y());
    cloud.set(i, "z", static_cast<double>(p.p_m.z()));
    cloud.set(i, "ring", p.ring);
    cloud.set(i, "time", static_cast<float>(to_seconds(p.fired - kBegin)));
  }
  const auto tested = decoder();
  ASSERT_EQ(begin(*tested, cloud), std::nullopt);
  expect_all_of(turn, drain(*tested));
}

TEST(CloudDecoder, UnitIsInferredFromTheValues) {
  for (const double unit_s : {1.0, 1e-3, 1e-6, 1e-9}) {
    const CloudTurn turn = round_room();
    OwnCloud cloud = timed_in(unit_s, turn);
    cloud.fields.back().name = "timestamp";
    const auto tested = decoder();
    ASSERT_EQ(begin(*tested, cloud), std::nullopt);
    expect_all_of(turn, drain(*tested));
    EXPECT_TRUE(tested->doubts().none()) << unit_s;
  }
}

/// A lidar that faces the sky has a few columns only: 3 of them span 194 us, 5 span 388 us.
TEST(CloudDecoder, FewColumnsUseTheUnitOfEarlierClouds) {
  for (const double unit_s : {1.0, 1e-3, 1e-6, 1e-9}) {
    const auto tested = decoder();
    for (const std::size_t columns : {1024U, 3U, 1024U, 1024U, 1024U, 5U, 3U}) {
      const CloudTurn turn = many_lasers(columns, kBegin + kTurn * static_cast<int>(tested->counters().used));
      ASSERT_EQ(begin(*tested, timed_in(unit_s, turn), turn.begin + kTurn + kWay), std::nullopt) << unit_s << columns;
      EXPECT_EQ(tested->timing(), PointTiming::field);
      expect_all_of(turn, drain(*tested));
    }
    EXPECT_TRUE(tested->doubts().none()) << unit_s;
  }
}

/// A span below one turn in the finest or the coarsest unit is a partial turn, not another unit.
TEST(CloudDecoder, FewColumnsInTheFirstCloudRaiseNoDoubt) {
  for (const auto& [unit_s, columns] : {std::pair{1e-9, 5U}, {1e-9, 4U}, {1.0, 2U}, {1.0, 5U}}) {
    const auto tested = decoder();
    const CloudTurn turn = many_lasers(columns);
    ASSERT_EQ(begin(*tested, timed_in(unit_s, turn)), std::nullopt);
    EXPECT_EQ(tested->timing(), PointTiming::field);
    expect_all_of(turn, drain(*tested));
    EXPECT_TRUE(tested->doubts().none()) << unit_s << ", " << columns << " columns";
  }
}

/// Several turns in one cloud look like one turn in a finer unit.
TEST(CloudDecoder, WrongUnitIsCorrected) {
  const auto tested = decoder();
  CloudTurn turns = round_room();
  for (FiredPoint& point : turns.points)
    point.fired = kBegin + 8 * (point.fired - kBegin);
  begin(*tested, timed_in(1.0, turns));
  for (int k = 9; k < 13; ++k) {
    const CloudTurn turn = round_room(kBegin + k * kTurn);
    ASSERT_EQ(begin(*tested, timed_in(1.0, turn), turn.begin + kTurn + kWay), std::nullopt);
    if (k >= 10)
      expect_all_of(turn, drain(*tested));
  }
}

/// Decodes a turn that is stamped with its begin and arrives `after` it. Returns the time of its first point relative
/// to the begin.
std::optional<Duration> first_point(CloudDecoder& decoder, int turn, Duration after) {
  const CloudTurn room = round_room(kBegin + turn * kTurn);
  if (begin(decoder, cloud_of(room, CloudKind::velodyne_start), room.begin + after))
    return std::nullopt;
  return drain(decoder).front().stamp - room.begin;
}

TEST(CloudDecoder, OneEarlyCloudDoesNotShiftOthers) {
  const auto tested = decoder();
  for (int k = 0; k < 40; ++k) {
    const bool is_early = k % 10 >= 6; // up to four in a row
    const std::optional<Duration> first = first_point(*tested, k, is_early ? milliseconds{30} : kTurn + kWay);
    EXPECT_EQ(first, is_early ? std::nullopt : std::optional{Duration{}}) << k;
  }
  EXPECT_TRUE(tested->doubts().none());
}

TEST(CloudDecoder, EarlyFirstCloudDoesNotShiftOthers) {
  const auto tested = decoder();
  EXPECT_LT(first_point(*tested, 0, milliseconds{30}), -milliseconds{90});
  for (int k = 1; k < 10; ++k)
    EXPECT_EQ(first_point(*tested, k, kTurn + kWay), Duration{}) << k;
  EXPECT_TRUE(tested->doubts().none());
}

TEST(CloudDecoder, StampsOfTheLastPointAreReportedUntilSomeAreNot) {
  const auto tested = decoder();
  for (int k = 0; k < 4; ++k) {
    EXPECT_LT(first_point(*tested, k, kWay), -milliseconds{90}) << k;
    EXPECT_FALSE(has(*tested, CloudDoubt::stamp_at_end)) << k;
  }
  for (int k = 4; k < 10; ++k)
    EXPECT_LT(first_point(*tested, k, kWay), -milliseconds{90}) << k;
  EXPECT_TRUE(has(*tested, CloudDoubt::stamp_at_end));
  EXPECT_EQ(tested->last_doubted()[static_cast<std::size_t>(CloudDoubt::stamp_at_end)], kBegin + 9 * kTurn + kWay);
  for (int k = 10; k < 14; ++k)
    EXPECT_LT(first_point(*tested, k, kTurn + kWay), -milliseconds{90}) << k;
  for (int k = 14; k < 20; ++k)
    EXPECT_EQ(first_point(*tested, k, kTurn + kWay), Duration{}) << k;
  EXPECT_EQ(tested->last_doubted()[static_cast<std::size_t>(CloudDoubt::stamp_at_end)], kBegin + 14 * kTurn + kWay)
      << "the clouds since are sound";
}

TEST(CloudDecoder, PointsWithoutReturnAreCountedAndDropped) {
  CloudTurn turn = round_room();
  OwnCloud cloud = cloud_of(turn, CloudKind::velodyne_start);
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInfinite = std::numeric_limits<float>::infinity();
  cloud.set(3, "x", kNan);
  cloud.set(4, "z", kInfinite);
  for (const char* const axis : {"x", "y", "z"})
    cloud.set(5, axis, 0.0F);
  cloud.set(6, "time", kNan);
  cloud.set(7, "y", 3e38F);
  const auto tested = decoder();
  ASSERT_EQ(begin(*tested, cloud), std::nullopt);
  EXPECT_EQ(drain(*tested).size(), turn.points.size() - 5);
  EXPECT_EQ(tested->counters().points, turn.points.size());
  EXPECT_EQ(tested->counters().nan, 3U);
  EXPECT_EQ(tested->counters().origin, 1U);
  EXPECT_EQ(tested->counters().untimed, 1U);
}

TEST(CloudDecoder, CloudWithoutReturnsIsAccepted) {
  const auto tested = decoder();
  const CloudTurn nothing{kBegin, {}};
  for (const CloudKind kind : {CloudKind::velodyne_start, CloudKind::ouster, CloudKind::bare}) {
    ASSERT_EQ(begin(*tested, cloud_of(nothing, kind)), std::nullopt);
    EXPECT_TRUE(drain(*tested).empty());
  }
  EXPECT_EQ(tested->counters().used, 3U);
  EXPECT_EQ(tested->counters().origin, tested->counters().points);
}

TEST(CloudDecoder, InconsistentSizesAreRejected) {
  const OwnCloud whole = cloud_of(round_room(), CloudKind::velodyne_start);
  const auto tested = decoder();
  const auto refused = [&](const auto& change) {
    CloudView message = whole.view();
    change(message);
    const auto error = tested->begin(message, kBegin + kTurn + kWay);
    EXPECT_EQ(tested->next(), nullptr);
    return error;
  };
  EXPECT_EQ(refused([](CloudView& m) { m.data = m.data.first(m.data.size() - 1); }), CloudError::cut);
  EXPECT_EQ(refused([](CloudView& m) { m.data = {}; }), CloudError::cut);
  EXPECT_EQ(refused([](CloudView& m) { ++m.width; }), CloudError::cut);
  EXPECT_EQ(refused([](CloudView& m) { m.height = 2; }), CloudError::cut);
  EXPECT_EQ(refused([](CloudView& m) { m.height = 2, m.width /= 2, m.row_step = 1; }), CloudError::cut);
  EXPECT_EQ(refused([](CloudView& m) { m.height = 2, m.width /= 2, m.row_step = ~0U; }), CloudError::cut);
  EXPECT_EQ(refused([](CloudView& m) { m.point_step = ~0U; }), CloudError::cut);
  EXPECT_EQ(refused([](CloudView& m) { m.height = m.width = ~0U; }), CloudError::too_large);
  EXPECT_EQ(refused([](CloudView& m) { m.width = ~0U, m.height = 1; }), CloudError::too_large);
  EXPECT_EQ(refused([](CloudView& m) { m.point_step = 4; }), CloudError::fields);
  EXPECT_EQ(refused([](CloudView& m) { m.storage[1].offset = ~0U; }), CloudError::fields);
  EXPECT_EQ(refused([](CloudView& m) { m.storage[1].type = Type{0}; }), CloudError::fields);
  EXPECT_EQ(refused([](CloudView& m) { m.storage[1].type = Type{200}; }), CloudError::fields);
  EXPECT_EQ(refused([](CloudView& m) { m.storage[1].type = Type::uint32; }), CloudError::fields);
  EXPECT_EQ(refused([](CloudView& m) { m.field_count = 2; }), CloudError::fields);
  EXPECT_EQ(tested->counters().used, 0U);
  EXPECT_EQ(tested->counters().received, 15U);
  EXPECT_EQ(tested->counters()[CloudError::cut], 7U);
  EXPECT_EQ(tested->counters()[CloudError::fields], 6U);
}

/// Fields of unknown type are ignored; the points are used.
TEST(CloudDecoder, FieldOfUnknownTypeIsIgnored) {
  OwnCloud cloud = cloud_of(round_room(), CloudKind::velodyne_start);
  cloud.fields[5].type = Type{77};
  const auto tested = decoder();
  ASSERT_EQ(begin(*tested, cloud), std::nullopt);
  EXPECT_TRUE(tested->doubts()[static_cast<std::size_t>(CloudDoubt::no_times)]);
  EXPECT_EQ(tested->timing(), PointTiming::azimuth);
}

TEST(CloudDecoder, DuplicatesAreRejectedAndLateCloudsCounted) {
  const auto tested = decoder();
  const OwnCloud first = cloud_of(round_room(), CloudKind::velodyne_start);
  const OwnCloud second = cloud_of(round_room(kBegin + kTurn), CloudKind::velodyne_start);
  EXPECT_EQ(begin(*tested, second, kBegin + 2 * kTurn + kWay), std::nullopt);
  EXPECT_EQ(begin(*tested, second, kBegin + 2 * kTurn + 2 * kWay), CloudError::duplicate);
  EXPECT_EQ(begin(*tested, first, kBegin + 2 * kTurn + 3 * kWay), std::nullopt);
  EXPECT_EQ(tested->counters().reordered, 1U);
  EXPECT_EQ(tested->counters()[CloudError::duplicate], 1U);
}

/// Drivers whose stamps are constant or whole seconds send no duplicates.
TEST(CloudDecoder, DifferentPointsWithTheSameStampAreNoDuplicate) {
  const auto tested = decoder();
  OwnCloud cloud = cloud_of(round_room(), CloudKind::velodyne_start);
  EXPECT_EQ(begin(*tested, cloud), std::nullopt);
  EXPECT_EQ(begin(*tested, cloud), CloudError::duplicate);
  for (std::size_t i = 0; i < cloud.width; ++i)
    cloud.set(i, "x", cloud.get<float>(i, "x") + 0.01F);
  EXPECT_EQ(begin(*tested, cloud), std::nullopt);
}

/// Clouds with too few points to determine the unit use that of the clouds before, however large their times are.
TEST(CloudDecoder, ToleratesAFewAbsurdPointTimes) {
  const auto tested = decoder();
  ASSERT_EQ(begin(*tested, cloud_of(round_room(), CloudKind::velodyne_start)), std::nullopt);
  for (const float time : {1e30F, -1e30F, 3e38F, 0.02F}) {
    CloudTurn few = round_room(kBegin + kTurn);
    few.points.resize(20);
    OwnCloud cloud = cloud_of(few, CloudKind::velodyne_start);
    cloud.stamp += seconds{static_cast<int>(tested->counters().used)}; // no duplicate
    for (std::size_t i = 0; i < few.points.size(); ++i)
      cloud.set(i, "time", time);
    ASSERT_EQ(begin(*tested, cloud, cloud.stamp + kTurn + kWay), std::nullopt) << time;
    EXPECT_EQ(drain(*tested).size(), few.points.size()) << time;
  }
}

/// Azimuths that go back indicate no rotating lidar: all points of a cloud without times have its stamp.
TEST(CloudDecoder, NonRotatingLidarHasNoTimesByAzimuth) {
  CloudTurn turn = round_room();
  for (std::size_t i = 0; i < turn.points.size(); ++i) // back and forth
    if (i / kRings % 20 >= 10)
      turn.points[i].p_m = turn.points[i - 2 * kRings * (i / kRings % 20 - 10) - kRings].p_m;
  OwnCloud cloud = cloud_of(turn, CloudKind::velodyne_start);
  remove_field(cloud, "time");
  const auto tested = decoder();
  ASSERT_EQ(begin(*tested, cloud), std::nullopt);
  EXPECT_EQ(tested->timing(), PointTiming::instant);
  for (const Fired& fired : drain(*tested)) {
    EXPECT_LE(fired.stamp, kBegin);
    EXPECT_GE(fired.stamp, kBegin - kInstant);
  }
}

/// Neighbours of a point on the rings above and below are those fired at its time, so one instant has an order, too.
TEST(CloudDecoder, PointsOfOneInstantAreOrderedByAzimuth) {
  const CloudTurn turn = round_room();
  for (const bool is_ring_by_ring : {false, true}) {
    CloudTurn stored = turn;
    if (is_ring_by_ring)
      std::ranges::stable_sort(stored.points, {}, &FiredPoint::ring);
    const auto tested = decoder(PointTimesFrom::none);
    ASSERT_EQ(begin(*tested, cloud_of(stored, CloudKind::velodyne_start)), std::nullopt);
    EXPECT_EQ(tested->timing(), PointTiming::instant);
    const std::vector<Fired> fired = drain(*tested);
    ASSERT_EQ(fired.size(), turn.points.size());
    for (const Fired& f : fired) {
      const double turned_rad =
          std::numbers::pi - std::atan2(static_cast<double>(f.what.y_m), static_cast<double>(f.what.x_m));
      const double share = turned_rad / (2 * std::numbers::pi);
      EXPECT_LE(f.stamp, kBegin);
      EXPECT_NEAR(to_seconds(f.stamp - kBegin), (share - 1) * to_seconds(kInstant), 1e-7) << is_ring_by_ring;
    }
  }
}

/// An organised cloud of a lidar that does not rotate: its columns, or its rows if there are more of them, are fired
/// one after the other.
TEST(CloudDecoder, OrganisedCloudOfOneInstantIsOrderedByItsLongerDimension) {
  constexpr std::uint32_t kLines = 8, kShots = 200;
  for (const bool is_wide : {true, false}) {
    OwnCloud cloud;
    cloud.stamp = kBegin;
    cloud.height = is_wide ? kLines : kShots;
    cloud.width = is_wide ? kShots : kLines;
    cloud.point_step = 12;
    cloud.fields = {{"x", 0, Type::float32}, {"y", 4, Type::float32}, {"z", 8, Type::float32}};
    cloud.data.resize(std::size_t{kLines} * kShots * cloud.point_step);
    const auto place = [&](std::uint32_t line, std::uint32_t shot) {
      return is_wide ? line * kShots + shot : shot * kLines + line;
    };
    for (std::uint32_t line = 0; line < kLines; ++line)
      for (std::uint32_t shot = 0; shot < kShots; ++shot) {
        const auto zigzag = static_cast<float>(shot % 20 < 10 ? shot % 20 : 20 - shot % 20);
        cloud.set(place(line, shot), "x", 5.0F);
        cloud.set(place(line, shot), "y", 0.1F * zigzag);
        cloud.set(place(line, shot), "z", static_cast<float>(line) + 1e-3F * static_cast<float>(shot));
      }
    const auto tested = decoder(PointTimesFrom::none);
    ASSERT_EQ(begin(*tested, cloud), std::nullopt);
    for (const Fired& f : drain(*tested)) {
      const double shot = 1000 * (static_cast<double>(f.what.z_m) - std::floor(static_cast<double>(f.what.z_m)));
      EXPECT_NEAR(to_seconds(f.stamp - kBegin), (shot + 1 - kShots) / kShots * to_seconds(kInstant), 1e-7) << is_wide;
    }
  }
}

TEST(CloudDecoder, BigEndianCloudsGiveTheSamePoints) {
  const CloudTurn turn = round_room();
  OwnCloud cloud = cloud_of(turn, CloudKind::hesai);
  const auto bytes_of = [](Type type) { return type == Type::float64 ? 8 : type == Type::uint16 ? 2 : 4; };
  for (std::size_t point = 0; point < cloud.width; ++point)
    for (const OwnCloud::Field& field : cloud.fields) {
      const auto at = cloud.data.begin() + static_cast<std::ptrdiff_t>(point * cloud.point_step + field.offset);
      std::reverse(at, at + bytes_of(field.type));
    }
  CloudView message = cloud.view();
  message.is_big_endian = true;
  const auto tested = decoder();
  ASSERT_EQ(tested->begin(message, kBegin + kTurn + kWay), std::nullopt);
  EXPECT_TRUE(tested->doubts().none());
  expect_all_of(turn, drain(*tested));
}

/// A clock that starts with the lidar has small numbers at first.
TEST(CloudDecoder, TimesSinceStartUpAreRecognisedFromTheFirstMinute) {
  for (const double since_start_s : {2.0, 55.0, 3000.0}) {
    const CloudTurn turn = round_room();
    OwnCloud cloud = timed_in(1.0, turn);
    for (std::size_t i = 0; i < turn.points.size(); ++i)
      cloud.set(i, "t", cloud.get<double>(i, "t") + since_start_s);
    const auto tested = decoder();
    ASSERT_EQ(begin(*tested, cloud), std::nullopt) << since_start_s;
    EXPECT_TRUE(tested->doubts().none()) << since_start_s;
    expect_all_of(turn, drain(*tested));
  }
}

/// Times of another clock do not say whether the header's stamp is that of the first or of the last point.
TEST(CloudDecoder, StampOfTheLastPointIsFoundForAForeignClock) {
  const CloudTurn turn = round_room();
  OwnCloud cloud = timed_in(1.0, turn);
  for (std::size_t i = 0; i < turn.points.size(); ++i)
    cloud.set(i, "t", cloud.get<double>(i, "t") + 3000);
  cloud.stamp = turn.end();
  const auto tested = decoder();
  ASSERT_EQ(begin(*tested, cloud), std::nullopt);
  expect_all_of(turn, drain(*tested));
}

/// Decodes turns with these begins, in periods; each arrives after the one before, and after its own end.
CloudDoubts doubts_of_begins(const std::vector<int>& begins) {
  const auto tested = decoder();
  Stamp arrival = kBegin;
  float differs_m = 0; // otherwise one with the same stamp is a duplicate
  for (const int periods : begins) {
    const CloudTurn turn = round_room(kBegin + periods * kTurn);
    OwnCloud cloud = cloud_of(turn, CloudKind::hesai);
    cloud.set(0, "x", differs_m += 0.01F);
    arrival = std::max(arrival + kWay, turn.begin + kTurn + kWay);
    EXPECT_EQ(begin(*tested, cloud, arrival), std::nullopt);
    drain(*tested);
  }
  return tested->doubts();
}

TEST(CloudDecoder, StampsThatDoNotAdvanceFromCloudToCloudAreReported) {
  CloudDoubts backwards;
  backwards.set(static_cast<std::size_t>(CloudDoubt::backwards));
  EXPECT_EQ(doubts_of_begins({0, 1, 2, 1}), backwards) << "the clock was set back";
  EXPECT_EQ(doubts_of_begins({0, 0, 1, 1, 3, 3}), CloudDoubts{}) << "may stand still once";
  EXPECT_EQ(doubts_of_begins({0, 0, 0, 0}), backwards);
  EXPECT_EQ(doubts_of_begins({0, 1, 3, 4, 8, 9}), CloudDoubts{}) << "some are lost";
}

/// Two drivers with the same topic: the first lidar is used until it is silent.
TEST(CloudDecoder, CloudsOfAnotherFrameBelongToAnotherLidar) {
  const auto tested = decoder();
  for (int k = 0; k < 5; ++k) {
    OwnCloud cloud = cloud_of(round_room(kBegin + k * kTurn), CloudKind::hesai);
    EXPECT_EQ(begin(*tested, cloud, kBegin + (k + 1) * kTurn + kWay), std::nullopt) << k;
    EXPECT_EQ(has(*tested, CloudDoubt::two_frames), k > 0);
    cloud.frame = "rear";
    EXPECT_EQ(begin(*tested, cloud, kBegin + (k + 1) * kTurn + 2 * kWay), CloudError::frame) << k;
  }
  EXPECT_EQ(tested->counters()[CloudError::frame], 5U);
  OwnCloud renamed = cloud_of(round_room(kBegin + 20 * kTurn), CloudKind::hesai);
  renamed.frame = "rear";
  EXPECT_EQ(begin(*tested, renamed, kBegin + 21 * kTurn + kWay), std::nullopt);
}

TEST(CloudDecoder, FractionsOfTheTurnAreNotTimes) {
  const CloudTurn turn = round_room();
  for (const double whole : {0.01, 1.0, 100.0, 360.0}) {
    OwnCloud cloud = timed_in(to_seconds(kTurn) / whole, turn);
    const auto tested = decoder();
    ASSERT_EQ(begin(*tested, cloud), std::nullopt);
    EXPECT_TRUE(has(*tested, CloudDoubt::no_unit) || whole == 100.0) << whole;
    EXPECT_EQ(tested->timing(), whole == 100.0 ? PointTiming::field : PointTiming::azimuth) << "100: milliseconds";
  }
}

TEST(CloudDecoder, ManyLasersFillManyPackets) {
  const CloudTurn turn = many_lasers(1024);
  const auto tested = decoder();
  ASSERT_EQ(begin(*tested, cloud_of(turn, CloudKind::velodyne_start)), std::nullopt);
  expect_all_of(turn, drain(*tested));
}

TEST(CloudMessages, CutAndAbsurdMessagesAreRejected) {
  std::vector<std::byte> bytes(100, std::byte{0xff});
  for (const auto type : {kPointCloudType, std::string_view{"livox_ros_driver2/CustomMsg"}}) {
    for (std::size_t size = 0; size < bytes.size(); ++size)
      EXPECT_FALSE(read_cloud({std::span(bytes).first(size), Serialisation::ros1}, type));
    bytes[0] = std::byte{0}, bytes[1] = std::byte{1};
    for (std::size_t size = 0; size < bytes.size(); ++size)
      EXPECT_FALSE(read_cloud({std::span(bytes).first(size), Serialisation::cdr}, type));
  }
}

} // namespace
} // namespace locus::test

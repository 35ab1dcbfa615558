// SPDX-License-Identifier: Apache-2.0
// Replay of a drive in the format of KITTI's raw data.
#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <numbers>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "core/base/pose.hpp"
#include "kitti/kitti_drive.hpp"
#include "kitti/kitti_points.hpp"
#include "kitti/kitti_sweep.hpp"
#include "replay_run.hpp"
#include "support/errors.hpp"
#include "support/kitti_room.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;
using tools::KittiPoint;
using tools::KittiSweep;

constexpr double kTurn = 2.0 * std::numbers::pi;
using kitti_room::kPeriod;

Eigen::Vector3d position_of(const KittiPoint& p) { return Eigen::Vector3f{p.x_m, p.y_m, p.z_m}.cast<double>(); }
double elevation_rad(const KittiPoint& p) { return std::asin(position_of(p).normalized().z()); }
double azimuth_rad(const KittiPoint& p) { return std::atan2(position_of(p).y(), position_of(p).x()); }

KittiPoint point_at(double range_m, double azimuth_rad, double elevation_rad) {
  const double level_m = range_m * std::cos(elevation_rad);
  const Eigen::Vector3d p{level_m * std::cos(azimuth_rad), level_m * std::sin(azimuth_rad),
                          range_m * std::sin(elevation_rad)};
  return {static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z()), 0.25F};
}

/// A copy for tests that modify it.
class KittiReplay : public testing::Test {
 protected:
  KittiReplay() { std::filesystem::copy(kitti_room_drive(), drive_, std::filesystem::copy_options::recursive); }

  [[nodiscard]] std::filesystem::path points(int sweep) const {
    return drive_ / fmt::format("velodyne_points/data/{:010}.txt", sweep);
  }
  /// Applies a change to all points of the drive, and stores them in binary.
  template <class Change> void rewrite_points(Change&& change) const {
    for (int sweep = 0; sweep < kitti_room::kSweeps; ++sweep) {
      std::vector<KittiPoint> all;
      ASSERT_TRUE(tools::read_kitti_points(points(sweep), all));
      std::ranges::for_each(all, change);
      std::ofstream{points(sweep).replace_extension(".bin"), std::ios::binary}.write(
          reinterpret_cast<const char*>(all.data()), static_cast<std::streamsize>(all.size() * sizeof(KittiPoint)));
      std::filesystem::remove(points(sweep));
    }
  }
  void expect_refused(const std::vector<std::string>& said) const {
    const ProgramRun run = Replay({drive_}).run();
    EXPECT_EQ(run.status, 1);
    EXPECT_EQ(lines_of(run.err).size(), 1U) << run.err;
    for (const std::string& part : said)
      EXPECT_TRUE(contains(run.err, part)) << "no '" << part << "' in: " << run.err;
  }

  TemporaryFolder folder_;
  std::filesystem::path drive_ = folder_ / "drive_0001_extract";
};

TEST(Kitti, DriveIsReplayedAndComparedWithItsInertialUnit) {
  const Replay replay({"--kitti-as-published", kitti_room_drive()});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_EQ(replay.run().err, "");
  EXPECT_TRUE(contains(replay.run().out, "velodyne_points is lidar front, oxts is imu, oxts is the truth"))
      << replay.run().out;
  const nlohmann::json summary = replay.summary();
  EXPECT_NEAR(summary["sweeps"]["seen"], kitti_room::kSweeps, 1);
  EXPECT_EQ(summary["packets"]["total"]["received"], summary["packets"]["total"]["data"]);
  EXPECT_EQ(summary["packets"]["total"]["lost"], 0);
  EXPECT_GT(summary["points"]["raw_mean"], 0.9 * kitti_room::kRings * kitti_room::kColumns);
  EXPECT_GT(summary["sources"]["imu"]["used_sweeps"], kitti_room::kSweeps - 5);
  EXPECT_LT(summary["ape_m"]["max"], 0.02) << "points at wrong times are 5 cm off";
}

TEST(Kitti, RelativePathMayEndWithASlash) {
  const auto drive = tools::KittiDrive::open(kitti_room_drive().string() + "/");
  ASSERT_TRUE(drive) << drive.error();
  EXPECT_TRUE(drive->warnings.empty()) << "the calibration lies beside the drive";
  EXPECT_EQ(drive->sweeps.size(), static_cast<std::size_t>(kitti_room::kSweeps));
  EXPECT_EQ(drive->truth.size(), 10U * kitti_room::kSweeps);
}

TEST(Kitti, PointHasTheTimeOfItsAzimuthAndTheRingOfItsIndex) {
  std::vector<KittiPoint> points;
  for (const int ring : {0, 1, 2}) {
    for (double ccw_deg = 1; ccw_deg < 360; ccw_deg += 2) {
      const Eigen::Vector3f p = (10 * kitti_room::direction(20 * ring, -ccw_deg * kTurn / 360)).cast<float>();
      points.push_back({p.x(), p.y(), p.z(), 1.0F});
    }
  }
  KittiSweep sweep;
  const Stamp start = stamp_from_ns(1'000'000'000);
  ASSERT_TRUE(sweep.begin(points, start, start + kPeriod));
  std::size_t returns = 0;
  Stamp last = start;
  while (const LidarPacket* packet = sweep.next()) {
    EXPECT_EQ(packet->stamp, last) << "no gap";
    last = packet->stamp + packet->duration;
    for (const FiringGroup& group : packet->firing_groups()) {
      for (std::size_t k = 0; k < FiringGroup::kLasers; ++k) {
        const LidarReturn r = group[k];
        if (r.range_m <= 0)
          continue;
        ++returns;
        const Eigen::Vector3d p_m = Eigen::Vector3f{r.x_m, r.y_m, r.z_m}.cast<double>();
        const double elevation_deg = std::asin(p_m.normalized().z()) * 360 / kTurn;
        const double from_rear = 0.5 + std::atan2(-p_m.y(), p_m.x()) / kTurn; // in turns: left 0.25, front 0.5
        EXPECT_NEAR(to_seconds(packet->stamp + Duration{r.offset_ns} - start), 0.1 * from_rear, 1e-6);
        EXPECT_EQ(r.ring, 2 - std::lround((2.0 - elevation_deg) / (20 * 26.8 / 63)));
        EXPECT_EQ(r.ring, group.first_laser + k);
      }
    }
  }
  EXPECT_EQ(last, start + kPeriod);
  EXPECT_EQ(returns, points.size());
}

TEST(Kitti, InvalidPointsAreDroppedAndAnotherOrderIsAnError) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();
  KittiSweep sweep;
  const Stamp start = stamp_from_ns(1);
  ASSERT_TRUE(sweep.begin(std::vector<KittiPoint>{{kNan, 1, 1, 0}, {0, 0, 0, 0}, {kInf, 0, 0, 0}, {1, 1, 0, kNan}},
                          start, start + kPeriod));
  std::size_t returns = 0;
  while (const LidarPacket* packet = sweep.next())
    for (const FiringGroup& group : packet->firing_groups())
      returns += static_cast<std::size_t>(std::ranges::count_if(group.range_m, [](float r) { return r != 0; }));
  EXPECT_EQ(returns, 1U);
  ASSERT_TRUE(sweep.begin({}, start, start + kPeriod));
  std::vector<KittiPoint> clockwise;
  for (int i = 0; i < 1000; ++i)
    clockwise.push_back({std::cos(0.3F * static_cast<float>(i)), -std::sin(0.3F * static_cast<float>(i)), 0, 0});
  EXPECT_FALSE(sweep.begin(clockwise, start, start + kPeriod));
  EXPECT_EQ(sweep.next(), nullptr);
}

TEST_F(KittiReplay, MissingOrDamagedSweepsAreSkipped) {
  std::filesystem::remove(points(5));
  std::ofstream{points(12), std::ios::app} << "1.0 2.0\n";
  std::filesystem::resize_file(points(20), 0);
  std::ofstream{points(30)} << "1.0 2.0 metres 0.3\n";
  const Replay replay({"--kitti-as-published", drive_});
  EXPECT_EQ(replay.run().status, 0);
  EXPECT_TRUE(contains(replay.run().err, "1 sweeps lack their points in data or their time")) << replay.run().err;
  EXPECT_TRUE(contains(replay.run().err, "3 sweeps are truncated or not points, 0 not in the order"))
      << replay.run().err;
  EXPECT_TRUE(contains(replay.run().err, "calib_imu_to_velo.txt")) << "it was not copied";
  EXPECT_GT(replay.summary()["sweeps"]["processed"], 30);
}

/// KITTI's own drives lack some sweeps, too: no file, and a blank line in its place.
TEST_F(KittiReplay, BlankTimesMarkMissingSweeps) {
  for (const char* const name : {"timestamps_start.txt", "timestamps_end.txt"}) {
    const std::filesystem::path file = drive_ / "velodyne_points" / name;
    std::vector<std::string> times = lines_of(read_text(file));
    std::ofstream stream{file};
    for (std::size_t i = 0; i < times.size(); ++i)
      stream << (i >= 17 && i < 21 ? "" : times[i]) << '\n';
  }
  for (const int sweep : {17, 18, 19, 20})
    std::filesystem::remove(points(sweep));
  std::filesystem::copy(kitti_room_drive().parent_path() / "calib_imu_to_velo.txt", folder_.path());
  const Replay replay({"--kitti-as-published", drive_});
  EXPECT_EQ(replay.run().status, 0);
  EXPECT_EQ(replay.run().err, "");
  EXPECT_LT(replay.summary()["ape_m"]["max"], 0.02);
}

/// Synchronised drives have binary points.
TEST_F(KittiReplay, PointsInBinaryGiveTheSameBits) {
  const Replay text({"--kitti-as-published", drive_});
  rewrite_points([](const KittiPoint&) {});
  std::filesystem::resize_file(points(39).replace_extension(".bin"), 1001);
  const Replay binary({"--kitti-as-published", drive_});
  EXPECT_TRUE(contains(binary.run().err, "1 sweeps are truncated or not points")) << binary.run().err;
  const std::string all = read_text(text.file("odometry.tum")), less = read_text(binary.file("odometry.tum"));
  EXPECT_EQ(less.substr(0, less.size() / 2), all.substr(0, less.size() / 2));
  EXPECT_GT(lines_of(less).size(), 35U);
}

TEST_F(KittiReplay, BadTimesAreNamedWithFileAndLine) {
  const std::filesystem::path starts = drive_ / "velodyne_points/timestamps_start.txt";
  for (const char* const line : {"2011-13-26 13:02:25.9", "2011-09-26", "nan", "2011-09-26 13:02:nan"}) {
    std::ofstream{starts} << "2023-11-14 22:13:20.0\n" << line << "\n";
    expect_refused({"timestamps_start.txt:2", "2011-09-26 13:02:25.964389445"});
  }
  std::filesystem::remove(starts);
  expect_refused({"timestamps_start.txt", "cannot be read"});
  std::ofstream{starts} << "2023-11-14 23:13:20.0\n";
  expect_refused({"no sweep that has points"});
}

TEST_F(KittiReplay, WithoutInertialUnitRunsOnLidarAlone) {
  std::filesystem::remove_all(drive_ / "oxts");
  const Replay replay({"--kitti-as-published", drive_});
  EXPECT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_FALSE(replay.summary().contains("ape_m"));
  EXPECT_TRUE(contains(replay.run().out, "velodyne_points is lidar front; its vertical")) << replay.run().out;
}

/// The rate of a synchronised drive.
TEST_F(KittiReplay, InertialUnitAtTenHertzDoesToo) {
  for (int i = 0; i < 10 * kitti_room::kSweeps; ++i) {
    if (i % 10 != 0)
      std::filesystem::remove(drive_ / fmt::format("oxts/data/{:010}.txt", i));
  }
  const Replay replay({"--kitti-as-published", drive_});
  EXPECT_EQ(replay.run().status, 0);
  EXPECT_TRUE(contains(replay.run().err, "360 records cannot be read")) << replay.run().err;
  EXPECT_EQ(replay.summary()["sources"]["imu"]["received"], kitti_room::kSweeps);
  EXPECT_LT(replay.summary()["ape_m"]["max"], 0.05);
}

TEST(Kitti, RaisedPointsRetainRangeAndAzimuth) {
  constexpr std::array kElevations_deg{-24.8, -10.0, -0.205, 0.0, 2.0};
  for (const double elevation_deg : kElevations_deg) {
    for (double azimuth_deg = -180; azimuth_deg < 180; azimuth_deg += 45) {
      std::vector<KittiPoint> points{point_at(40, azimuth_deg * kRadPerDeg, elevation_deg * kRadPerDeg)};
      tools::raise(points, 0.205);
      const KittiPoint& raised = points.front();
      constexpr double kOfFloats = 2e-5;
      EXPECT_NEAR(elevation_rad(raised) / kRadPerDeg, elevation_deg + 0.205, kOfFloats);
      EXPECT_NEAR(position_of(raised).norm(), 40, kOfFloats);
      EXPECT_NEAR(std::remainder(azimuth_rad(raised) / kRadPerDeg - azimuth_deg, 360.0), 0, kOfFloats);
      EXPECT_EQ(raised.reflectance, 0.25F);
    }
  }
}

TEST(Kitti, PointsWithoutAVerticalPlaneAreUnchanged) {
  std::vector<KittiPoint> points{{0, 0, 0, 0}, {0, 0, 5, 0}, {std::numeric_limits<float>::quiet_NaN(), 1, 1, 0}};
  tools::raise(points, 0.205);
  EXPECT_EQ(points[0].z_m, 0);
  EXPECT_EQ(points[1].z_m, 5);
  EXPECT_TRUE(std::isnan(points[2].x_m));
}

/// Each point has KITTI's elevation error: at a distance of four metres the floor is 14 mm too low.
TEST_F(KittiReplay, SmallAnglesAreCorrected) {
  const Replay truth({"--kitti-as-published", drive_});
  rewrite_points([](KittiPoint& p) {
    p = point_at(position_of(p).norm(), azimuth_rad(p), elevation_rad(p) - 0.205 * kRadPerDeg);
  });
  const std::string map = truth.file("map.pcd");
  const Replay wrong({"--kitti-as-published", "--map-truth", map, drive_}), right({"--map-truth", map, drive_});
  ASSERT_EQ(wrong.run().status, 0) << wrong.run().err;
  ASSERT_EQ(right.run().status, 0) << right.run().err;
  const double wrong_m = wrong.summary()["map_error_m"]["rmse"], right_m = right.summary()["map_error_m"]["rmse"];
  EXPECT_GT(wrong_m, 0.003);
  EXPECT_LT(right_m, 0.1 * wrong_m);
  EXPECT_LT(right.summary()["ape_m"]["max"], 0.02) << "as that of the unchanged points";
  EXPECT_TRUE(contains(right.run().out, "0.205 degrees are added to its vertical angles")) << right.run().out;
  EXPECT_TRUE(contains(wrong.run().out, "its vertical angles are as published")) << wrong.run().out;
  EXPECT_EQ(right.summary()["kitti_vertical_angle_added_deg"], 0.205);
  EXPECT_EQ(wrong.summary()["kitti_vertical_angle_added_deg"], 0);
}

TEST(Kitti, AsPublishedRequiresADrive) {
  const Replay replay({"--kitti-as-published", room_drive()});
  EXPECT_EQ(replay.run().status, 2);
  EXPECT_TRUE(contains(replay.run().err, "is not a drive of KITTI")) << replay.run().err;
}

TEST_F(KittiReplay, PacketFaultsAreAnError) {
  const ProgramRun run = Replay({"--fail", "front:lost@1-2", drive_}).run();
  EXPECT_EQ(run.status, 2);
  EXPECT_TRUE(contains(run.err, "--fail front")) << run.err;
  EXPECT_EQ(Replay({"--fail", "imu:lost@1-2", drive_}).run().status, 0);
}

} // namespace
} // namespace locus::test

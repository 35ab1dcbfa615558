// SPDX-License-Identifier: Apache-2.0
// A drive in the format of KITTI's raw data in place of a capture.
#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <numbers>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "kitti/kitti_drive.hpp"
#include "kitti/kitti_sweep.hpp"
#include "replay_run.hpp"
#include "support/errors.hpp"
#include "support/scenes.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;
using tools::KittiPoint;
using tools::KittiSweep;

constexpr double kTurn = 2.0 * std::numbers::pi;
constexpr int kRings = 64;
constexpr Duration kPeriod = milliseconds{100};

std::string time_text(Stamp stamp) {
  const auto whole_seconds = std::chrono::floor<std::chrono::seconds>(stamp.time_since_epoch());
  return fmt::format("{:%Y-%m-%d %H:%M:%S}.{:09}\n", fmt::gmtime(static_cast<std::time_t>(whole_seconds.count())),
                     (stamp.time_since_epoch() - whole_seconds).count());
}

/// `clockwise_rad` 0 in front.
Eigen::Vector3d direction(int ring_from_top, double clockwise_rad) {
  const double elevation_rad = (2.0 - 26.8 * ring_from_top / (kRings - 1)) * std::numbers::pi / 180.0;
  return {std::cos(elevation_rad) * std::cos(clockwise_rad), -std::cos(elevation_rad) * std::sin(clockwise_rad),
          std::sin(elevation_rad)};
}

/// What a drive around a room in KITTI's format holds. Each point is where the lidar saw it when it was fired.
class RoomDrive {
 public:
  static constexpr int kSweeps = 40, kColumns = 720;

  explicit RoomDrive(const std::filesystem::path& day) : day_(day), drive_(day / "2023_11_14_drive_0001_extract") {
    std::filesystem::create_directories(drive_ / "velodyne_points/data");
    std::filesystem::create_directories(drive_ / "oxts/data");
    write_points();
    write_oxts();
    std::ofstream{day_ / "calib_imu_to_velo.txt"}
        << "calib_time: 25-May-2012 16:47:16\nR: 1 0 0 0 1 0 0 0 1\nT: -0.8 0.3 -0.8\n";
  }
  [[nodiscard]] const std::filesystem::path& folder() const { return drive_; }

 private:
  [[nodiscard]] Pose T_world_lidar(Stamp stamp) const {
    return trajectory_.T_world_base(stamp) * Pose{Eigen::Quaterniond::Identity(), {0, 0, 1}};
  }

  void write_points() const {
    const sim::Scene room = sim::room();
    std::ofstream starts{drive_ / "velodyne_points/timestamps_start.txt"},
        ends{drive_ / "velodyne_points/timestamps_end.txt"};
    for (int sweep = 0; sweep < kSweeps; ++sweep) {
      const Stamp start = trajectory_.start() + sweep * kPeriod;
      starts << time_text(start);
      ends << time_text(start + kPeriod);
      std::ofstream points{drive_ / fmt::format("velodyne_points/data/{:010}.bin", sweep), std::ios::binary};
      for (int ring = 0; ring < kRings; ++ring) {
        for (int column = 0; column < kColumns; ++column) { // counter-clockwise, the first few ahead of the front
          const double clockwise_rad = std::remainder(-kTurn * (column - ring % 3) / kColumns, kTurn);
          const Pose T = T_world_lidar(start + from_seconds((0.5 + clockwise_rad / kTurn) * to_seconds(kPeriod)));
          const Eigen::Vector3d ray = direction(ring, clockwise_rad);
          const auto hit = room.cast({T.translation, T.rotation * ray}, 100);
          if (!hit)
            continue;
          const Eigen::Vector3f p_m = (hit->range_m * ray).cast<float>();
          const KittiPoint point{p_m.x(), p_m.y(), p_m.z(), 0.5F};
          points.write(reinterpret_cast<const char*>(&point), sizeof(point));
        }
      }
    }
  }

  void write_oxts() const {
    constexpr double kEarth_m = 6378137.0, kDegPerRad = 180.0 / std::numbers::pi, kLat_deg = 49.0, kLon_deg = 8.4;
    const double scale_m = kEarth_m * std::cos(kLat_deg / kDegPerRad);
    const double first_y_m = scale_m * std::log(std::tan((90 + kLat_deg) / kDegPerRad / 2));
    const Pose T_lidar_unit{Eigen::Quaterniond::Identity(), {-0.8, 0.3, -0.8}};
    const Eigen::Vector3d first = (T_world_lidar(trajectory_.start()) * T_lidar_unit).translation;
    std::ofstream times{drive_ / "oxts/timestamps.txt"};
    for (int i = 0; i < 10 * kSweeps; ++i) {
      const Stamp stamp = trajectory_.start() + i * milliseconds{10};
      const sim::BaseMotion motion = trajectory_.at(stamp);
      const Pose T = T_world_lidar(stamp) * T_lidar_unit;
      const Eigen::Vector3d moved = T.translation - first;
      const Eigen::Vector3d rpy = to_rpy_rad(T.rotation);
      const Eigen::Vector3d force =
          T.rotation.inverse() * (motion.acceleration_world_mps2 + kGravity_mps2 * Eigen::Vector3d::UnitZ());
      const Eigen::Vector3d& rate = motion.angular_velocity_base_radps;
      times << time_text(stamp);
      std::ofstream{drive_ / fmt::format("oxts/data/{:010}.txt", i)}
          << fmt::format("{:.17g} {:.17g} {} {} {} {} 0 0 0 0 0 {} {} {} 0 0 0 {} {} {} 0 0 0 0 0 4 11 6 6 6\n",
                         2 * std::atan(std::exp((first_y_m + moved.y()) / scale_m)) * kDegPerRad - 90,
                         kLon_deg + moved.x() / scale_m * kDegPerRad, 110 + moved.z(), rpy.x(), rpy.y(), rpy.z(),
                         force.x(), force.y(), force.z(), rate.x(), rate.y(), rate.z());
    }
  }

  std::filesystem::path day_, drive_;
  sim::Trajectory trajectory_{sim::room_course(kSweeps * kPeriod, 1.0), sim::room_start()};
};

const std::filesystem::path& room() {
  static const TemporaryFolder day;
  static const RoomDrive drive(day.path());
  return drive.folder();
}

/// A copy that a test may spoil.
class KittiReplay : public testing::Test {
 protected:
  KittiReplay() { std::filesystem::copy(room(), drive_, std::filesystem::copy_options::recursive); }

  [[nodiscard]] std::filesystem::path points(int sweep) const {
    return drive_ / fmt::format("velodyne_points/data/{:010}.bin", sweep);
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

TEST(Kitti, DriveIsReplayedAndMeasuredByItsInertialUnit) {
  const Replay replay({room()});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_EQ(replay.run().err, "");
  EXPECT_TRUE(contains(replay.run().out, "velodyne_points is lidar front, oxts is imu, oxts is the truth"))
      << replay.run().out;
  const nlohmann::json summary = replay.summary();
  EXPECT_NEAR(summary["sweeps"]["seen"], RoomDrive::kSweeps, 1);
  EXPECT_EQ(summary["packets"]["total"]["received"], summary["packets"]["total"]["data"]);
  EXPECT_EQ(summary["packets"]["total"]["lost"], 0);
  EXPECT_GT(summary["points"]["raw_mean"], 0.9 * kRings * RoomDrive::kColumns);
  EXPECT_GT(summary["sources"]["imu"]["used_sweeps"], RoomDrive::kSweeps - 5);
  EXPECT_LT(summary["ape_m"]["max"], 0.02) << "points at wrong times are 5 cm off";
}

TEST(Kitti, RelativePathWithSlashIsTheSameDrive) {
  const auto drive = tools::KittiDrive::open(room().string() + "/");
  ASSERT_TRUE(drive) << drive.error();
  EXPECT_TRUE(drive->warnings.empty()) << "the calibration lies beside the drive";
  EXPECT_EQ(drive->sweeps.size(), static_cast<std::size_t>(RoomDrive::kSweeps));
  EXPECT_EQ(drive->truth.size(), 10U * RoomDrive::kSweeps);
}

TEST(Kitti, PointHasTheTimeOfItsAzimuthAndTheRingOfItsPlace) {
  std::vector<KittiPoint> points;
  for (const int ring : {0, 1, 2}) {
    for (double ccw_deg = 1; ccw_deg < 360; ccw_deg += 2) {
      const Eigen::Vector3f p = (10 * direction(20 * ring, -ccw_deg * kTurn / 360)).cast<float>();
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
    for (const Salvo& salvo : packet->salvos()) {
      for (std::size_t k = 0; k < Salvo::kLasers; ++k) {
        const LidarReturn r = salvo[k];
        if (r.range_m <= 0)
          continue;
        ++returns;
        const Eigen::Vector3d p_m = Eigen::Vector3f{r.x_m, r.y_m, r.z_m}.cast<double>();
        const double elevation_deg = std::asin(p_m.normalized().z()) * 360 / kTurn;
        const double from_rear = 0.5 + std::atan2(-p_m.y(), p_m.x()) / kTurn; // left is a quarter, the front a half
        EXPECT_NEAR(to_seconds(packet->stamp + Duration{r.offset_ns} - start), 0.1 * from_rear, 1e-6);
        EXPECT_EQ(r.ring, 2 - std::lround((2.0 - elevation_deg) / (20 * 26.8 / 63)));
        EXPECT_EQ(r.ring, salvo.first_laser + k);
      }
    }
  }
  EXPECT_EQ(last, start + kPeriod);
  EXPECT_EQ(returns, points.size());
}

TEST(Kitti, PointsThatAreNoneAreLeftOutAndAnotherOrderIsRefused) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();
  KittiSweep sweep;
  const Stamp start = stamp_from_ns(1);
  ASSERT_TRUE(sweep.begin(std::vector<KittiPoint>{{kNan, 1, 1, 0}, {0, 0, 0, 0}, {kInf, 0, 0, 0}, {1, 1, 0, kNan}},
                          start, start + kPeriod));
  std::size_t returns = 0;
  while (const LidarPacket* packet = sweep.next())
    for (const Salvo& salvo : packet->salvos())
      returns += static_cast<std::size_t>(std::ranges::count_if(salvo.range_m, [](float r) { return r != 0; }));
  EXPECT_EQ(returns, 1U);
  ASSERT_TRUE(sweep.begin({}, start, start + kPeriod));
  std::vector<KittiPoint> clockwise;
  for (int i = 0; i < 1000; ++i)
    clockwise.push_back({std::cos(0.3F * static_cast<float>(i)), -std::sin(0.3F * static_cast<float>(i)), 0, 0});
  EXPECT_FALSE(sweep.begin(clockwise, start, start + kPeriod));
  EXPECT_EQ(sweep.next(), nullptr);
}

TEST_F(KittiReplay, SweepsThatAreMissingOrDamagedAreLeftOut) {
  std::filesystem::remove(points(5));
  std::filesystem::resize_file(points(12), 1001);
  std::filesystem::resize_file(points(20), 0);
  const Replay replay({drive_});
  EXPECT_EQ(replay.run().status, 0);
  EXPECT_TRUE(contains(replay.run().err, "1 sweeps have a time but no .bin")) << replay.run().err;
  EXPECT_TRUE(contains(replay.run().err, "2 sweeps are cut or no points, 0 not in the order")) << replay.run().err;
  EXPECT_TRUE(contains(replay.run().err, "calib_imu_to_velo.txt")) << "it was not copied";
  EXPECT_GT(replay.summary()["sweeps"]["processed"], 30);
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
  expect_refused({"no sweep that has a .bin and a time"});
}

TEST_F(KittiReplay, WithoutInertialUnitTheLidarIsAlone) {
  std::filesystem::remove_all(drive_ / "oxts");
  const Replay replay({drive_});
  EXPECT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_FALSE(replay.summary().contains("ape_m"));
  EXPECT_TRUE(contains(replay.run().out, "velodyne_points is lidar front\n")) << replay.run().out;
}

/// As in a drive that was synchronised.
TEST_F(KittiReplay, InertialUnitAtTenHertzDoesToo) {
  for (int i = 0; i < 10 * RoomDrive::kSweeps; ++i) {
    if (i % 10 != 0)
      std::filesystem::remove(drive_ / fmt::format("oxts/data/{:010}.txt", i));
  }
  const Replay replay({drive_});
  EXPECT_EQ(replay.run().status, 0);
  EXPECT_TRUE(contains(replay.run().err, "360 records cannot be read")) << replay.run().err;
  EXPECT_EQ(replay.summary()["sources"]["imu"]["received"], RoomDrive::kSweeps);
  EXPECT_LT(replay.summary()["ape_m"]["max"], 0.05);
}

TEST_F(KittiReplay, FaultsOfPacketsAreRefused) {
  const ProgramRun run = Replay({"--fail", "front:lost@1-2", drive_}).run();
  EXPECT_EQ(run.status, 2);
  EXPECT_TRUE(contains(run.err, "--fail front")) << run.err;
  EXPECT_EQ(Replay({"--fail", "imu:lost@1-2", drive_}).run().status, 0);
}

} // namespace
} // namespace locus::test

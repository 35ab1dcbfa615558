// SPDX-License-Identifier: Apache-2.0
#include "support/kitti_room.hpp"

#include <fstream>
#include <string>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include "core/sources/motion_sample.hpp"
#include "support/scenes.hpp"

namespace locus::test::kitti_room {

namespace {

using std::chrono::milliseconds;

constexpr double kTurn = 2.0 * std::numbers::pi;

std::string time_text(Stamp stamp) {
  const auto whole_seconds = std::chrono::floor<std::chrono::seconds>(stamp.time_since_epoch());
  return fmt::format("{:%Y-%m-%d %H:%M:%S}.{:09}\n", fmt::gmtime(static_cast<std::time_t>(whole_seconds.count())),
                     (stamp.time_since_epoch() - whole_seconds).count());
}

/// Each point is in the lidar's frame at its firing time (not de-skewed).
class RoomDrive {
 public:
  explicit RoomDrive(const std::filesystem::path& day) : day_(day), drive_(day / "2023_11_14_drive_0001_extract") {
    std::filesystem::create_directories(drive_ / "velodyne_points/data");
    std::filesystem::create_directories(drive_ / "oxts/data");
    write_points();
    write_oxts();
    write_calibration();
  }

 private:
  void write_calibration() const {
    const Eigen::Matrix3d R = T_lidar_unit_.rotation.toRotationMatrix();
    const Eigen::Vector3d& T = T_lidar_unit_.translation;
    const Eigen::IOFormat kInOneLine(Eigen::FullPrecision, Eigen::DontAlignCols, " ", " ");
    std::ofstream{day_ / "calib_imu_to_velo.txt"} << "calib_time: 25-May-2012 16:47:16\nR: " << R.format(kInOneLine)
                                                  << "\nT: " << T.format(kInOneLine) << '\n';
  }

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
      std::ofstream points{drive_ / fmt::format("velodyne_points/data/{:010}.txt", sweep)};
      for (int ring = 0; ring < kRings; ++ring) {
        for (int column = 0; column < kColumns; ++column) { // counter-clockwise, starting slightly ahead of the front
          const double clockwise_rad = std::remainder(-kTurn * (column - ring % 3) / kColumns, kTurn);
          const Pose T = T_world_lidar(start + from_seconds((0.5 + clockwise_rad / kTurn) * to_seconds(kPeriod)));
          const Eigen::Vector3d ray = direction(ring, clockwise_rad);
          const auto hit = room.cast({T.translation, T.rotation * ray}, 100);
          if (!hit)
            continue;
          const Eigen::Vector3d p_m = hit->range_m * ray;
          points << fmt::format("{:.3f} {:.3f} {:.3f} 0.50\n", p_m.x(), p_m.y(), p_m.z());
        }
      }
    }
  }

  void write_oxts() const {
    constexpr double kEarth_m = 6378137.0, kDegPerRad = 180.0 / std::numbers::pi, kLat_deg = 49.0, kLon_deg = 8.4;
    const double scale_m = kEarth_m * std::cos(kLat_deg / kDegPerRad);
    const double first_y_m = scale_m * std::log(std::tan((90 + kLat_deg) / kDegPerRad / 2));
    const Eigen::Vector3d first = (T_world_lidar(trajectory_.start()) * T_lidar_unit_).translation;
    std::ofstream times{drive_ / "oxts/timestamps.txt"};
    for (int i = 0; i < 10 * kSweeps; ++i) {
      const Stamp stamp = trajectory_.start() + i * milliseconds{10};
      const sim::BaseMotion motion = trajectory_.at(stamp);
      const Pose T = T_world_lidar(stamp) * T_lidar_unit_;
      const Eigen::Vector3d moved = T.translation - first;
      const Eigen::Vector3d rpy = to_rpy_rad(T.rotation);
      const Eigen::Vector3d force =
          T.rotation.inverse() * (motion.acceleration_world_mps2 + kGravity_mps2 * Eigen::Vector3d::UnitZ());
      const Eigen::Vector3d rate = T_lidar_unit_.rotation.inverse() * motion.angular_velocity_base_radps;
      times << time_text(stamp);
      std::ofstream{drive_ / fmt::format("oxts/data/{:010}.txt", i)}
          << fmt::format("{:.17g} {:.17g} {} {} {} {} 0 0 0 0 0 {} {} {} 0 0 0 {} {} {} 0 0 0 0 0 4 11 6 6 6\n",
                         2 * std::atan(std::exp((first_y_m + moved.y()) / scale_m)) * kDegPerRad - 90,
                         kLon_deg + moved.x() / scale_m * kDegPerRad, 110 + moved.z(), rpy.x(), rpy.y(), rpy.z(),
                         force.x(), force.y(), force.z(), rate.x(), rate.y(), rate.z());
    }
  }

  std::filesystem::path day_, drive_;
  Pose T_lidar_unit_{from_rpy_rad({0.01, 0.005, -0.03}), {-0.8, 0.3, -0.8}};
  sim::Trajectory trajectory_{sim::room_course(kSweeps * kPeriod, 1.0), sim::room_start()};
};

} // namespace

void write_drive(const std::filesystem::path& day) { const RoomDrive drive(day); }

} // namespace locus::test::kitti_room

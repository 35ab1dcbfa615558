// SPDX-License-Identifier: Apache-2.0
// Effects of the imperfections on a robot's lidars and motion sources.
#include "locus_sim/impairment.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <numbers>
#include <set>
#include <string>
#include <vector>

#include <Eigen/Eigenvalues>

#include "drivers/velodyne/decoder.hpp"
#include "drivers/velodyne/position_packet.hpp"
#include "locus_sim/own_parts.hpp"
#include "support/returns.hpp"

namespace locus::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

Robot spot_with(const Imperfections& imperfections, std::uint64_t seed = 1) {
  return make_spot({.lidars = 3, .imperfections = imperfections}, seed);
}

/// Returns the robot's configuration file.
std::string config_of(const RobotOptions& robot) {
  struct : CaptureSink {
    void datagram(const Datagram&) override {}
    void text(std::string_view file, Stamp, const std::string& lines) override {
      if (file == "config.yaml")
        config = lines;
    }
    void close() override {}

    std::string config;
  } sink;
  const Trajectory trajectory(Course{}.stand(seconds{1}));
  write_capture(sink, Scene({}), trajectory, milliseconds{10}, robot);
  return sink.config;
}

TEST(Mounting, ErrorIsAsRequestedAndTheConfigurationHasNone) {
  const Robot right = spot_with({}), wrong = spot_with({.mounting_deg = 2, .mounting_mm = 30});
  const auto expect_displaced = [](const Pose& truth, const Pose& intended) {
    EXPECT_NEAR((truth.translation - intended.translation).norm(), 0.03, 1e-9);
    EXPECT_NEAR(angle_rad(intended.rotation.conjugate() * truth.rotation), 2 * kRadPerDeg, 1e-9);
  };
  for (std::size_t i = 0; i < 3; ++i)
    expect_displaced(wrong.sensors.lidars[i].options.T_base_lidar, right.sensors.lidars[i].options.T_base_lidar);
  expect_displaced(wrong.sensors.imu->T_base_imu, right.sensors.imu->T_base_imu);
  EXPECT_EQ(config_of(wrong.sensors), config_of(right.sensors));
}

TEST(Mounting, ErrorDiffersBetweenSensorsAndSeeds) {
  std::vector<Eigen::Vector3d> shifts, turns;
  for (const std::uint64_t seed : {1U, 2U}) {
    const Robot wrong = spot_with({.mounting_deg = 2, .mounting_mm = 30}, seed);
    const auto add = [&](const Pose& truth, const Pose& believed) {
      shifts.emplace_back((truth.translation - believed.translation).normalized());
      turns.emplace_back(so3_log(believed.rotation.conjugate() * truth.rotation).normalized());
    };
    for (const NamedLidar& lidar : wrong.sensors.lidars)
      add(lidar.options.T_base_lidar, *lidar.T_base_configured);
    add(wrong.sensors.imu->T_base_imu, *wrong.sensors.imu->T_base_configured);
  }
  for (std::size_t i = 0; i < shifts.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      EXPECT_GT((shifts[i] - shifts[j]).norm(), 0.01);
      EXPECT_GT((turns[i] - turns[j]).norm(), 0.01);
    }
}

constexpr double kBelow_m = 0.5, kAhead_m = 6; // from the base to the floor and to two walls

/// A floor below the base, a wall ahead and one to the left, and the points on each.
struct Corner {
  static Scene scene() {
    return Scene({{Rectangle{{-kAhead_m, -kAhead_m, -kBelow_m}, {2 * kAhead_m, 0, 0}, {0, 2 * kAhead_m, 0}}},
                  {Rectangle{{kAhead_m, -kAhead_m, -kBelow_m}, {0, 2 * kAhead_m, 0}, {0, 0, 5}}},
                  {Rectangle{{-kAhead_m, kAhead_m, -kBelow_m}, {2 * kAhead_m, 0, 0}, {0, 0, 5}}}});
  }

  std::vector<Eigen::Vector3d> ahead, left, floor;
};

/// Returns the corner's points in ten turns, transformed by the believed extrinsics.
Corner seen_of_corner(const NamedLidar& named) {
  constexpr double kNear_m = 0.7, kClear_m = 1; // distance to the plane; distance to the other two
  const Scene scene = Corner::scene();
  const Trajectory trajectory(Course{}.stand(seconds{2}));
  SyntheticLidar lidar(scene, trajectory, named.options);
  velodyne::Decoder decoder({.model = std::get<velodyne::Model>(named.options.model)});
  const auto packet = std::make_unique<LidarPacket>();
  Corner seen;
  for (int i = 0; i < 753; ++i) {
    if (decoder.decode(lidar.next().payload, *packet))
      continue;
    for (const LidarReturn& echo : test::returns_of(*packet)) {
      const Eigen::Vector3d point =
          *named.T_base_configured * Eigen::Vector3f{echo.x_m, echo.y_m, echo.z_m}.cast<double>();
      const Eigen::Array3d off = (point - Eigen::Vector3d{kAhead_m, kAhead_m, -kBelow_m}).array().abs();
      if (off.x() < kNear_m && off.y() > kClear_m && off.z() > kClear_m)
        seen.ahead.push_back(point);
      if (off.y() < kNear_m && off.x() > kClear_m && off.z() > kClear_m)
        seen.left.push_back(point);
      if (off.z() < kNear_m && off.x() > kClear_m && off.y() > kClear_m)
        seen.floor.push_back(point);
    }
  }
  return seen;
}

Eigen::Vector3d mean_of(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points)
    sum += point;
  return sum / static_cast<double>(points.size());
}

/// Returns the normal of the plane through the points, on the side of `about`.
Eigen::Vector3d normal_of(const std::vector<Eigen::Vector3d>& points, const Eigen::Vector3d& about) {
  const Eigen::Vector3d mean = mean_of(points);
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& point : points)
    spread += (point - mean) * (point - mean).transpose();
  const Eigen::Vector3d normal = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors().col(0);
  return normal.dot(about) < 0 ? Eigen::Vector3d(-normal) : normal;
}

NamedLidar level_lidar(const Imperfections& imperfections, std::uint64_t seed) {
  return make_spot({.noise = false, .imperfections = imperfections}, seed).sensors.lidars.front();
}

TEST(Mounting, RotationErrorTurnsFloorAndWalls) {
  double steepest_rad = 0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const Corner seen = seen_of_corner(level_lidar({.mounting_deg = 2}, seed));
    Eigen::Matrix3d turned;
    turned << normal_of(seen.ahead, Eigen::Vector3d::UnitX()), normal_of(seen.left, Eigen::Vector3d::UnitY()),
        normal_of(seen.floor, Eigen::Vector3d::UnitZ());
    EXPECT_NEAR(angle_rad(Eigen::Quaterniond(turned)), 2 * kRadPerDeg, 0.03 * kRadPerDeg) << "seed " << seed;
    steepest_rad = std::max(steepest_rad, std::acos(turned.col(2).z()));
  }
  EXPECT_GT(steepest_rad, 1.5 * kRadPerDeg) << "nowhere the floor is tilted";
  EXPECT_LT(steepest_rad, 2.03 * kRadPerDeg);
}

TEST(Mounting, TranslationErrorShiftsFloorAndWalls) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const Corner seen = seen_of_corner(level_lidar({.mounting_mm = 30}, seed));
    const Eigen::Vector3d shift_m{mean_of(seen.ahead).x() - kAhead_m, mean_of(seen.left).y() - kAhead_m,
                                  mean_of(seen.floor).z() + kBelow_m};
    EXPECT_NEAR(shift_m.norm(), 0.03, 0.001) << "seed " << seed;
  }
}

TEST(Mounting, RotationErrorOfAnImuTiltsItsGravity) {
  const Trajectory trajectory(Course{}.stand(seconds{1}));
  double steepest_rad = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const MountedImu mounted = *make_husky({.noise = false, .imperfections = {.mounting_deg = 2}}, seed).sensors.imu;
    SyntheticImu imu(trajectory, 200, mounted.faults, 1, mounted.T_base_imu);
    const Eigen::Vector3d up_mps2 = mounted.T_base_configured->rotation * imu.next().specific_force_mps2;
    EXPECT_NEAR(up_mps2.norm(), kGravity_mps2, 1e-9);
    const double tilt_rad = std::asin(up_mps2.head<2>().norm() / kGravity_mps2);
    EXPECT_LT(tilt_rad, 2 * kRadPerDeg + 1e-9) << "about an axis that is not level it is less";
    steepest_rad = std::max(steepest_rad, tilt_rad);
  }
  EXPECT_GT(steepest_rad, 1.95 * kRadPerDeg);
}

TEST(Impairment, AppliesToEveryRobot) {
  for (const NamedRobot& named : kRobots) {
    const Robot robot = named.make({.imperfections = {.mounting_mm = 30, .imu_late_ms = 5, .odometry_late_ms = 20}}, 1);
    EXPECT_TRUE(robot.sensors.lidars.front().T_base_configured) << named.name;
    EXPECT_TRUE(!robot.sensors.imu || robot.sensors.imu->faults.stamps.late == milliseconds{5}) << named.name;
    for (const NamedOdometry& odometry : robot.sensors.odometry)
      EXPECT_EQ(odometry.faults.stamps.late, milliseconds{20}) << named.name;
  }
}

TEST(Impairment, OfOneKindDoesNotDependOnOthers) {
  const Robot alone = spot_with({.mounting_mm = 30, .gyro_scale_percent = 1});
  Imperfections all = imperfections_of(Realism::harsh);
  all.mounting_mm = 30;
  all.gyro_scale_percent = 1;
  const Robot among = spot_with(all);
  EXPECT_EQ(alone.sensors.lidars[0].options.T_base_lidar.translation,
            among.sensors.lidars[0].options.T_base_lidar.translation);
  EXPECT_EQ(alone.sensors.imu->faults.gyro_axis_scale_error, among.sensors.imu->faults.gyro_axis_scale_error);
}

TEST(BodyBox, ContainsThePartsOfTheRobotOnly) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Dice dice(seed);
    const Eigen::Vector3d lidar_m{0.1, 0, 0.8};
    const OwnParts parts = own_parts(8, lidar_m, dice);
    ASSERT_EQ(parts.surfaces.size(), 8U);
    for (std::size_t i = 0; i < parts.surfaces.size(); ++i) {
      const Bounds part = std::visit([](const auto& shape) { return shape.bounds(); }, parts.surfaces[i].shape);
      const bool holds = (part.min_m.array() > parts.body_box->min_m.array()).all() &&
                         (part.max_m.array() < parts.body_box->max_m.array()).all();
      const bool is_apart = (part.min_m.array() > parts.body_box->max_m.array()).any() ||
                            (part.max_m.array() < parts.body_box->min_m.array()).any();
      EXPECT_EQ(holds, i % 2 == 0) << "part " << i << " seed " << seed;
      EXPECT_EQ(is_apart, i % 2 == 1) << "part " << i << " seed " << seed;
      const double away_m =
          std::visit([&](const auto& shape) { return shape.distance_m(lidar_m); }, parts.surfaces[i].shape);
      EXPECT_GT(away_m, SyntheticLidarOptions{}.min_range_m) << "part " << i << " seed " << seed;
    }
  }
}

TEST(BodyBox, IsConfiguredIfPartsAreInView) {
  EXPECT_EQ(config_of(spot_with({}).sensors).find("body_box"), std::string::npos);
  const Robot robot = spot_with({.body_parts = 2});
  EXPECT_NE(config_of(robot.sensors).find("body_box: {enabled: true, min_m: [-"), std::string::npos);
  for (const NamedLidar& lidar : robot.sensors.lidars)
    EXPECT_EQ(lidar.options.own_parts.size(), 2U);
}

TEST(LidarClock, DriftingClockHasNoGps) {
  const SyntheticLidarOptions kept = spot_with({}).sensors.lidars[0].options;
  EXPECT_TRUE(kept.pps_locked);
  EXPECT_EQ(kept.clock_offset, Duration::zero());
  const SyntheticLidarOptions left = spot_with({.lidar_drift_ppm = 60}).sensors.lidars[0].options;
  EXPECT_DOUBLE_EQ(left.drift, 60e-6);
  EXPECT_FALSE(left.pps_locked);
  EXPECT_NE(left.clock_offset, Duration::zero());
}

velodyne::PositionPacket position_packet_of(const Robot& robot) {
  const Scene nothing({});
  const Trajectory trajectory(Course{}.stand(seconds{1}));
  SyntheticLidar lidar(nothing, trajectory, robot.sensors.lidars[0].options);
  Datagram datagram = lidar.next();
  while (datagram.payload.size() != velodyne::kPositionPacketBytes)
    datagram = lidar.next();
  return velodyne::parse_position_packet(datagram.payload.first<velodyne::kPositionPacketBytes>());
}

TEST(LidarClock, DriftingClockIsUnlockedInPositionPackets) {
  const velodyne::PositionPacket kept = position_packet_of(spot_with({}));
  EXPECT_TRUE(kept.is_synchronised());
  const velodyne::PositionPacket left = position_packet_of(spot_with({.lidar_drift_ppm = 60}));
  EXPECT_EQ(left.pps, velodyne::PpsState::absent);
  ASSERT_TRUE(left.rmc);
  EXPECT_FALSE(left.rmc->valid);
  EXPECT_NE(left.time_of_hour, kept.time_of_hour);
}

struct Scatter {
  double mean_s = 0, deviation_s = 0;
};

Scatter scatter_of(const std::vector<double>& all_s) {
  Scatter scatter;
  const auto count = static_cast<double>(all_s.size());
  for (const double each_s : all_s)
    scatter.mean_s += each_s / count;
  for (const double each_s : all_s)
    scatter.deviation_s += std::pow(each_s - scatter.mean_s, 2) / count;
  scatter.deviation_s = std::sqrt(scatter.deviation_s);
  return scatter;
}

/// Returns the lateness of the stamps relative to a 5 ms grid; each sample is of its grid time.
template <class Source> Scatter lateness(Source source, Stamp start) {
  std::vector<double> all_s;
  Stamp last = start - seconds{1};
  for (int i = 0; i < 4000; ++i) {
    const auto sample = source.next();
    EXPECT_GT(sample.stamp, last);
    EXPECT_EQ(sample.arrival, sample.stamp);
    last = sample.stamp;
    all_s.push_back(to_seconds(sample.stamp - start) - 0.005 * i);
  }
  return scatter_of(all_s);
}

TEST(SourceStamps, AreLateWithJitterAndMonotonic) {
  const Trajectory trajectory(Course{}.stand(seconds{30}));
  for (const double jitter_s : {0.0005, 0.02}) { // the larger one disorders many stamps
    const StampFaults faults{.late = milliseconds{50}, .jitter_s = jitter_s};
    for (const Scatter scatter :
         {lateness(SyntheticImu(trajectory, 200, {.stamps = faults}), trajectory.start()),
          lateness(SyntheticOdometry(trajectory, 200, {.stamps = faults}), trajectory.start())}) {
      if (jitter_s < 0.001) {
        EXPECT_NEAR(scatter.mean_s, 0.05, 4 * jitter_s / std::sqrt(4000));
        EXPECT_NEAR(scatter.deviation_s, jitter_s, 0.05 * jitter_s);
      } else {
        EXPECT_GT(scatter.mean_s, 0.05); // backward stamps are raised
      }
    }
  }
}

TEST(SourceStamps, LateStampBelongsToEarlierMotion) {
  const Trajectory trajectory(Course{}.change_speed(2, seconds{1}).turn(3, 2.0));
  const Duration late = milliseconds{30};
  SyntheticOdometry odometry(trajectory, 50, {.stamps = {.late = late}});
  SyntheticImu imu(trajectory, 200, {.stamps = {.late = late}});
  const Pose T_source_world = trajectory.T_world_base(trajectory.start()).inverse();
  for (int i = 0; i < 100; ++i) {
    const OdometrySample sample = odometry.next();
    const Pose T_source_base = T_source_world * trajectory.T_world_base(sample.stamp - late);
    ASSERT_LT((sample.T_source_base.translation - T_source_base.translation).norm(), 1e-9);
    const ImuSample inertial = imu.next();
    ASSERT_LT(
        (inertial.angular_velocity_radps - trajectory.at(inertial.stamp - late).angular_velocity_base_radps).norm(),
        1e-12);
  }
}

/// Returns the ratio of reported to true distance at 50 Hz.
std::vector<double> reported_shares(const Trajectory& trajectory, double per_min, std::uint64_t seed) {
  SyntheticOdometry odometry(trajectory, 50, {.slip_bursts_per_min = per_min}, seed);
  OdometrySample last = odometry.next();
  std::vector<double> shares;
  for (OdometrySample now = odometry.next(); now.stamp <= trajectory.end(); last = now, now = odometry.next()) {
    const double driven_m =
        (trajectory.T_world_base(now.stamp).translation - trajectory.T_world_base(last.stamp).translation).norm();
    const double reported_m = (now.T_source_base.translation - last.T_source_base.translation).x();
    if (driven_m == 0)
      EXPECT_EQ(reported_m, 0);
    else
      shares.push_back(reported_m / driven_m);
  }
  return shares;
}

/// At constant speed. The bursts in ten minutes are Poisson distributed: the bounds are exceeded once in ten thousand.
TEST(SlipBursts, ReportTooMuchAtTheConfiguredRateAndDuration) {
  const Trajectory trajectory(Course{}.change_speed(1, milliseconds{1}).straight(600));
  int bursts = 0, run = 0;
  std::vector<double> shares = reported_shares(trajectory, 5, 3);
  shares.resize(shares.size() - 100); // braking at the end
  for (const double share : shares) {
    if (share > 1 + 1e-6) {
      EXPECT_GE(share, 1.2 - 1e-6);
      EXPECT_LE(share, 2 + 1e-6);
      ++run;
      continue;
    }
    EXPECT_NEAR(share, 1, 1e-6);
    if (run > 0) {
      EXPECT_GE(run, 24);
      ++bursts;
    }
    run = 0;
  }
  EXPECT_GT(bursts, 23);
  EXPECT_LT(bursts, 78);
}

TEST(SlipBursts, ReportTooLittleInBrakingAndNothingAtRest) {
  const Trajectory trajectory(
      Course{}.change_speed(10, milliseconds{1}).change_speed(0, seconds{20}).stand(seconds{20}));
  const std::vector<double> shares = reported_shares(trajectory, 60, 3);
  int dragging = 0;
  for (std::size_t i = 300; i < 700; ++i) { // hard braking
    EXPECT_LE(shares[i], 1 + 1e-6);
    EXPECT_GE(shares[i], -1e-6);
    dragging += shares[i] < 0.9;
  }
  EXPECT_GT(dragging, 25);
}

TEST(SlipBursts, AndTurnErrorsAffectOnlyWheelsAndLegs) {
  const Robot right = spot_with({}), wrong = spot_with({.slip_bursts_per_min = 3, .yaw_error_percent = 5});
  const auto &vision = wrong.sensors.odometry[0].faults, &legs = wrong.sensors.odometry[1].faults;
  EXPECT_EQ(vision.slip_bursts_per_min, 0);
  EXPECT_EQ(vision.turn_error, right.sensors.odometry[0].faults.turn_error);
  EXPECT_EQ(legs.slip_bursts_per_min, 3);
  EXPECT_NEAR(std::abs(legs.turn_error - right.sensors.odometry[1].faults.turn_error), 0.05, 1e-12);
}

/// Returns the ratio of reported to true yaw over one and a half turns to the left, at speed.
double reported_of_true_yaw(const NamedOdometry& named) {
  const double turn_rad = 3 * std::numbers::pi;
  const Trajectory trajectory(Course{}.change_speed(0.5, seconds{1}).turn(turn_rad, 0.9).change_speed(0, seconds{1}));
  SyntheticOdometry odometry(trajectory, named.rate_hz, named.faults);
  double sum_rad = 0;
  OdometrySample last = odometry.next();
  while (last.stamp < trajectory.end()) {
    const OdometrySample now = odometry.next();
    sum_rad += so3_log(last.T_source_base.rotation.conjugate() * now.T_source_base.rotation).z();
    last = now;
  }
  return sum_rad / turn_rad;
}

TEST(TurnErrors, ScaleTheReportedYawAsConfigured) {
  std::set<bool> signs;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const SensorChoice choice{.noise = false, .imperfections = {.yaw_error_percent = 5}};
    const double wheels = reported_of_true_yaw(make_husky(choice, seed).sensors.odometry[0]);
    EXPECT_NEAR(std::abs(wheels - 1), 0.05, 1e-6) << "seed " << seed;
    signs.insert(wheels > 1);
    const auto spot = make_spot(choice, seed).sensors.odometry;
    EXPECT_NEAR(reported_of_true_yaw(spot[0]), 1, 1e-6) << "vision, seed " << seed;
    EXPECT_NEAR(std::abs(reported_of_true_yaw(spot[1]) - 1), 0.05, 1e-6) << "legs, seed " << seed;
  }
  EXPECT_EQ(signs.size(), 2U);
}

/// Returns the difference between an IMU with faults and one without.
ImuSample excess(const Trajectory& trajectory, const ImuFaults& faults, Duration at) {
  const auto sample_at = [&](const ImuFaults& of) {
    SyntheticImu imu(trajectory, 200, of);
    ImuSample sample = imu.next();
    while (sample.stamp < trajectory.start() + at)
      sample = imu.next();
    return sample;
  };
  ImuSample with = sample_at(faults);
  const ImuSample without = sample_at({});
  with.angular_velocity_radps -= without.angular_velocity_radps;
  with.specific_force_mps2 -= without.specific_force_mps2;
  return with;
}

TEST(Gyro, HasAScaleErrorOnEachAxis) {
  const Trajectory trajectory(Course{}.change_speed(2, seconds{1}).turn(6, 2.0), {},
                              {.tilt_rad = 0.1, .wavelength_m = 2});
  const ImuFaults faults =
      make_spot({.noise = false, .imperfections = {.gyro_scale_percent = 3}}, 1).sensors.imu->faults;
  const Duration at = milliseconds{2500};
  const Eigen::Vector3d truth = trajectory.at(trajectory.start() + at).angular_velocity_base_radps;
  const Eigen::Vector3d error = excess(trajectory, faults, at).angular_velocity_radps;
  for (const Eigen::Index axis : {0, 1, 2}) {
    EXPECT_GT(std::abs(truth[axis]), 0.01);
    EXPECT_NEAR(std::abs(error[axis]), 0.03 * std::abs(truth[axis]), 1e-9);
  }
}

TEST(Gyro, IsSensitiveToAccelerationButNotToGravity) {
  const Trajectory trajectory(Course{}.change_speed(6, seconds{2}));
  const ImuFaults faults =
      make_spot({.noise = false, .imperfections = {.g_sensitivity_dps = 0.2}}, 1).sensors.imu->faults;
  EXPECT_EQ(excess(trajectory, faults, Duration::zero()).angular_velocity_radps.norm(), 0);
  const Duration at = seconds{1};
  const double g = trajectory.at(trajectory.start() + at).acceleration_world_mps2.norm() / kGravity_mps2;
  EXPECT_GT(g, 0.5);
  EXPECT_NEAR(excess(trajectory, faults, at).angular_velocity_radps.norm(), 0.2 * kRadPerDeg * g, 1e-9);
}

TEST(Gyro, BiasIsARandomWalk) {
  const Trajectory trajectory(Course{}.stand(seconds{1}));
  ImuFaults faults = make_spot({.noise = false, .imperfections = {.gyro_walk_dps = 0.1}}, 1).sensors.imu->faults;
  SyntheticImu imu(trajectory, 200, faults);
  constexpr int kRuns = 200, kSamples = 200; // samples of one second
  double sum = 0;
  Eigen::Vector3d begin = imu.next().angular_velocity_radps, now = begin;
  for (int run = 0; run < kRuns; ++run, begin = now) {
    for (int i = 0; i < kSamples; ++i)
      now = imu.next().angular_velocity_radps;
    sum += (now - begin).squaredNorm() / 3 / kRuns;
  }
  EXPECT_NEAR(std::sqrt(sum), 0.1 * kRadPerDeg, 0.12 * 0.1 * kRadPerDeg); // 600 draws
}

TEST(Accelerometer, VibratesWhileTheRobotMoves) {
  const Trajectory trajectory(Course{}.stand(seconds{5}).change_speed(1, milliseconds{1}).straight(20));
  const ImuFaults faults = make_spot({.noise = false, .imperfections = {.vibration_mps2 = 3}}, 1).sensors.imu->faults;
  SyntheticImu imu(trajectory, 200, faults);
  double standing = 0, driving = 0;
  for (int i = 0; i < 3000; ++i) {
    const double error = imu.next().specific_force_mps2.x();
    if (i < 1000)
      standing = std::max(standing, std::abs(error));
    else if (i > 1000)
      driving += error * error / 1999;
  }
  EXPECT_LT(standing, 1e-9);
  EXPECT_NEAR(std::sqrt(driving), 3, 0.2);
}

} // namespace
} // namespace locus::sim

// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/robot.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <utility>

#include "drivers/ouster/metadata.hpp"
#include "locus_sim/dice.hpp"
#include "locus_sim/impairment.hpp"

namespace locus::sim {
namespace {

struct Mounting {
  std::string_view name;
  Eigen::Vector3d xyz_m, rpy_deg;
};

Pose pose_of(const Mounting& mounting) { return {from_rpy_rad(kRadPerDeg * mounting.rpy_deg), mounting.xyz_m}; }

/// Returns the range; a VLS-128, here only for benchmarks, gets that of a VLP-16.
double max_range_m(const LidarModel& model) {
  const auto* const named = std::ranges::find(kLidarModels, model, &NamedLidarModel::model);
  return named == kLidarModels.end() ? kLidarModels.front().max_range_m : named->max_range_m;
}

/// Returns lidars of one model, each with a deviation in rotation rate and a random phase.
std::vector<NamedLidar> lidars(std::span<const Mounting> mountings, const SensorChoice& choice, Dice& dice) {
  std::vector<NamedLidar> all;
  for (const Mounting& mounting : mountings.first(static_cast<std::size_t>(choice.lidars))) {
    const auto index = static_cast<std::uint16_t>(all.size());
    SyntheticLidarOptions options;
    options.model = choice.model;
    options.return_mode = choice.return_mode;
    options.rpm = 600 + dice.between(-0.6, 0.6);
    options.first_azimuth_deg = dice.between(0, 360);
    options.T_base_lidar = pose_of(mounting);
    options.port = static_cast<std::uint16_t>(options.port + index);
    if (is_ouster(choice.model)) {
      options.port = static_cast<std::uint16_t>(ouster::kDefaultLidarPort + 2 * index);
      options.imu_port = static_cast<std::uint16_t>(options.port + 1);
    }
    options.source_ip += index;
    options.max_range_m = max_range_m(choice.model);
    options.sends_position_packets = std::holds_alternative<velodyne::Model>(choice.model);
    options.dust = choice.dust;
    if (choice.noise) {
      options.range_noise_m = 0.01;
      options.dropout = 0.003;
      options.fades = true;
      options.latency = std::chrono::microseconds{60};
    }
    options.seed = static_cast<std::uint64_t>(dice.between(1, 1e15));
    all.push_back({std::string(mounting.name), options});
  }
  return all;
}

Eigen::Vector3d anywhere(Dice& dice, double reach) {
  const double x = dice.between(-reach, reach), y = dice.between(-reach, reach), z = dice.between(-reach, reach);
  return {x, y, z};
}

/// Returns a random error of either sign, between half of `size` and `size`: no real sensor is perfect.
double about(Dice& dice, double size) { return (dice.chance(0.5) ? 1 : -1) * dice.between(0.5, 1) * size; }

/// Returns the errors of an industrial MEMS unit, its gyro calibrated at rest before the start; values of the data
/// sheet, not those of its best specimens.
ImuFaults imu_faults(Dice& dice, double vibration_mps2) {
  return {.gyro_bias_radps = anywhere(dice, 0.0015),
          .gyro_noise_radps = 0.003,
          .gyro_bias_walk_radps_per_sqrt_s = 3e-5,
          .gyro_scale_error = about(dice, 0.002),
          .accelerometer_bias_mps2 = anywhere(dice, 0.05),
          .accelerometer_noise_mps2 = 0.03,
          .vibration_mps2 = vibration_mps2,
          .attitude_noise_rad = 0.1 * kRadPerDeg,
          .attitude_wander_rad = 0.4 * kRadPerDeg,
          .heading_rad = dice.between(-std::numbers::pi, std::numbers::pi)};
}

/// Mounts an IMU on the robot, or in its lidars if these have their own.
void fit_imu(Robot& robot, const SensorChoice& choice, double vibration_mps2, const Pose& T_base_imu, Dice& dice) {
  const auto faults = [&] { return choice.noise ? imu_faults(dice, vibration_mps2) : ImuFaults{}; };
  robot.sensors.imu.reset();
  if (!is_ouster(choice.model))
    robot.sensors.imu = MountedImu{faults(), T_base_imu};
  else
    for (NamedLidar& lidar : robot.sensors.lidars)
      lidar.imu = faults();
}

/// Generates occasional rotations of the wrist, at up to 4 rad/s, mostly in yaw.
std::vector<Flick> flicks(double per_min, Duration duration, Dice& dice) {
  constexpr double kPeak_radps = 4, kPeakOfMean = 1.875;
  std::vector<Flick> all;
  double at_s = 3;
  while (per_min > 0) {
    at_s += dice.between(0.5, 1.5) * 60 / per_min;
    const double yaw_rad = (dice.chance(0.5) ? 1 : -1) * dice.between(0.5, 1.2);
    const double there_s = kPeakOfMean * std::abs(yaw_rad) / dice.between(0.75 * kPeak_radps, kPeak_radps);
    if (at_s + 2 * there_s > to_seconds(duration))
      break;
    all.push_back(
        {from_seconds(at_s), from_seconds(there_s), {dice.between(-0.15, 0.15), dice.between(-0.25, 0.25), yaw_rad}});
    at_s += 2 * there_s;
  }
  return all;
}

} // namespace

Robot make_husky(const SensorChoice& choice, std::uint64_t seed) {
  static const std::array<Mounting, 3> kLidars{
      {{"top", {0, 0, 0.8}, {0, 0, 0}}, {"front", {0.4, 0, 0.6}, {0, 30, 0}}, {"rear", {-0.4, 0, 0.6}, {0, 30, 180}}}};
  Dice dice(seed);
  Robot robot;
  robot.agility = {
      .cruise_mps = 1.0, .turn_rate_radps = 0.9, .acceleration_mps2 = 0.7, .sudden_mps2 = 2.2, .sudden_share = 0.15};
  robot.ride.base_height_m = 0.13;
  robot.ride.oscillations = {
      {2.3, {0, 0, 0}, kRadPerDeg * Eigen::Vector3d{0.2, 0.15, 0}, 0.4},                       // rocking on its tyres
      {9.7, {0, 0, 0.0004}, kRadPerDeg * Eigen::Vector3d{0.05, 0.1, 0}, 1.1},                  // tyre lugs
      {17.3, {0.0001, 0.0001, 0.00015}, kRadPerDeg * Eigen::Vector3d{0.04, 0.05, 0.01}, 2.0}}; // drive train
  robot.sensors.lidars = lidars(kLidars, choice, dice);
  fit_imu(robot, choice, 0.4, {Eigen::Quaterniond::Identity(), {0, 0, 0.3}}, dice);
  OdometryFaults wheels{.spinning_mps = robot.agility.cruise_mps}; // wheel spin is not a sensor fault
  if (choice.noise) {
    wheels.scale_error = about(dice, 0.015);
    wheels.noise_m_per_sqrt_m = 0.006;
    wheels.noise_rad_per_sqrt_m = 0.002;
    wheels.yaw_drift_rad_per_s = about(dice, 0.0005);
    wheels.turn_error = about(dice, 0.015);
    wheels.turn_slip_m_per_rad = dice.between(0.01, 0.03);
    wheels.climb_m_per_sqrt_m = 0.002;
  }
  robot.sensors.odometry = {{.faults = wheels}};
  robot.sensors.seed = seed;
  return impaired(std::move(robot), choice.imperfections, seed);
}

Robot make_spot(const SensorChoice& choice, std::uint64_t seed) {
  static const std::array<Mounting, 3> kLidars{{{"top", {0, 0, 0.4}, {0, 0, 0}},
                                                {"front", {0.35, 0, 0.3}, {0, 30, 0}},
                                                {"rear", {-0.35, 0, 0.3}, {0, 30, 180}}}};
  Dice dice(seed);
  Robot robot;
  robot.agility = {
      .cruise_mps = 1.2, .turn_rate_radps = 1.1, .acceleration_mps2 = 0.9, .sudden_mps2 = 2.5, .sudden_share = 0.1};
  robot.ride.base_height_m = 0.5;
  robot.ride.oscillations = {
      {2.0, {0.004, 0.012, 0.010}, kRadPerDeg * Eigen::Vector3d{1.5, 0.6, 0.5}, 0.3}, // the stride
      {4.0, {0.004, 0, 0.006}, kRadPerDeg * Eigen::Vector3d{0.2, 0.8, 0}, 1.7},       // its two steps
      {13.0, {0, 0, 0.0002}, kRadPerDeg * Eigen::Vector3d{0.04, 0.06, 0}, 0.9}};      // feet touching down
  robot.sensors.lidars = lidars(kLidars, choice, dice);
  fit_imu(robot, choice, 0.6, {}, dice);
  OdometryFaults vision{}, legs{.spinning_mps = robot.agility.cruise_mps};
  if (choice.noise) {
    vision.scale_error = about(dice, 0.01);
    vision.noise_m_per_sqrt_m = 0.008;
    vision.noise_rad_per_sqrt_m = 0.002;
    vision.yaw_drift_rad_per_m = about(dice, 0.0008);
    vision.climb_m_per_sqrt_m = 0.006;
    legs.scale_error = about(dice, 0.025);
    legs.noise_m_per_sqrt_m = 0.012;
    legs.noise_rad_per_sqrt_m = 0.004;
    legs.yaw_drift_rad_per_s = about(dice, 0.0008);
    legs.turn_error = about(dice, 0.02);
    legs.turn_slip_m_per_rad = dice.between(0.005, 0.02);
    legs.climb_m_per_sqrt_m = 0.012;
  }
  robot.sensors.odometry = {{.name = "vio", .topic = "/visual_odometry", .rate_hz = 30, .faults = vision},
                            {.name = "kio", .topic = "/kinematic_odometry", .rate_hz = 50, .faults = legs}};
  robot.sensors.seed = seed;
  return impaired(std::move(robot), choice.imperfections, seed);
}

Robot make_handheld(const SensorChoice& choice, std::uint64_t seed) {
  static const std::array<Mounting, 3> kLidars{
      {{"top", {0, 0, 0.1}, {0, 0, 0}}, {"front", {0.1, 0, 0}, {0, 30, 0}}, {"rear", {-0.1, 0, 0}, {0, 30, 180}}}};
  Dice dice(seed);
  Robot robot;
  robot.agility = {.cruise_mps = 1.2,
                   .turn_rate_radps = 1.6, // plus that of the gait
                   .acceleration_mps2 = 0.9,
                   .sudden_mps2 = 2,
                   .sudden_share = 0.2,
                   .flicks_per_min = 4};
  robot.ride.base_height_m = dice.between(1.25, 1.45); // plus the lidar, a hand above it
  robot.ride.oscillations = {
      {0.45, {0.02, 0.15, 0}, kRadPerDeg * Eigen::Vector3d{3, 2, 6}, 0.2},     // the arm swings it sideways
      {0.95, {0.01, 0.02, 0.005}, kRadPerDeg * Eigen::Vector3d{1.5, 1, 2}, 1}, // the stride
      {1.9, {0.01, 0, 0.02}, kRadPerDeg * Eigen::Vector3d{0.3, 1, 0.3}, 1.7}}; // its two steps
  robot.sensors.lidars = lidars(kLidars, choice, dice);
  fit_imu(robot, choice, 0.2, {}, dice);
  robot.sensors.odometry = {};
  robot.sensors.seed = seed;
  robot.reach_m = 0.25;
  return impaired(std::move(robot), choice.imperfections, seed);
}

Robot make_car(const SensorChoice& choice, std::uint64_t seed) {
  static const std::array<Mounting, 3> kLidars{
      {{"top", {0, 0, 1.5}, {0, 0, 0}}, {"front", {0.6, 0, 1.3}, {0, 20, 0}}, {"rear", {-0.6, 0, 1.3}, {0, 20, 180}}}};
  Dice dice(seed);
  Robot robot;
  robot.agility = {.cruise_mps = 15,
                   .turn_rate_radps = 0.5,
                   .acceleration_mps2 = 2,
                   .sudden_mps2 = 3,
                   .sudden_share = 0.15,
                   .halts = {.share = 0.03},
                   .cornering_mps2 = 2.5};
  robot.sensors.max_speed_mps = 40;
  robot.ride.base_height_m = 0.3;
  robot.ride.oscillations = {{1.3, {0, 0, 0.008}, kRadPerDeg * Eigen::Vector3d{0.25, 0.2, 0}, 0.4},    // on its springs
                             {11.5, {0, 0, 0.0005}, kRadPerDeg * Eigen::Vector3d{0.03, 0.04, 0}, 1.1}, // wheels
                             {28, {0.0001, 0.0001, 0.0001}, kRadPerDeg * Eigen::Vector3d{0.01, 0.02, 0}, 2}}; // engine
  robot.sensors.lidars = lidars(kLidars, choice, dice);
  fit_imu(robot, choice, 0.5, {Eigen::Quaterniond::Identity(), {0, 0, 0.2}}, dice);
  OdometryFaults wheels{.spinning_mps = 1};
  if (choice.noise) {
    wheels.scale_error = about(dice, 0.01);
    wheels.noise_m_per_sqrt_m = 0.005;
    wheels.noise_rad_per_sqrt_m = 0.0007;
    wheels.yaw_drift_rad_per_s = about(dice, 0.0005);
    wheels.turn_error = about(dice, 0.01);
    wheels.climb_m_per_sqrt_m = 0.004;
  }
  robot.sensors.odometry = {{.faults = wheels}};
  robot.sensors.seed = seed;
  robot.reach_m = 0.9;
  return impaired(std::move(robot), choice.imperfections, seed);
}

Trajectory drive_about(const World& world, const Robot& robot, Duration duration, const std::vector<Slip>& slips,
                       std::uint64_t seed) {
  Duration driving = duration;
  for (const Slip& slip : slips)
    driving -= slip.to - slip.from; // the course resumes where it stopped
  Dice dice(seed + 1);
  Agility agility = robot.agility;
  agility.cruise_mps = std::min(agility.cruise_mps, world.max_speed_mps);
  const PlannedCourse planned = plan_course(world.roads, agility, driving, dice);
  Ride ride = robot.ride;
  ride.ground_m = world.ground_m;
  ride.slips = slips;
  Dice wrist(seed + 2);
  ride.flicks = flicks(agility.flicks_per_min, duration, wrist);
  return Trajectory(planned.course, planned.start, world.terrain, ride);
}

} // namespace locus::sim

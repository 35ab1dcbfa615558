// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/impairment.hpp"

#include <cmath>
#include <numbers>
#include <optional>
#include <string>

#include "locus_sim/dice.hpp"
#include "locus_sim/own_parts.hpp"

namespace locus::sim {
namespace {

Eigen::Vector3d any_direction(Dice& dice) {
  const double z = dice.between(-1, 1), around_rad = dice.between(0, 2 * std::numbers::pi);
  const double level = std::sqrt(1 - z * z);
  return {level * std::cos(around_rad), level * std::sin(around_rad), z};
}

double either_sign(Dice& dice) { return dice.chance(0.5) ? 1 : -1; }

/// Keeps the nominal extrinsics as the believed ones and displaces the true ones.
void displace(Pose& T_base_sensor, std::optional<Pose>& believed, const Imperfections& all, std::uint64_t seed) {
  if (all.mounting_deg == 0 && all.mounting_mm == 0)
    return;
  believed = T_base_sensor;
  Dice dice(seed);
  T_base_sensor.rotation = T_base_sensor.rotation * so3_exp(kRadPerDeg * all.mounting_deg * any_direction(dice));
  T_base_sensor.translation += 1e-3 * all.mounting_mm * any_direction(dice);
}

StampFaults stamp_faults(double late_ms, double jitter_ms) {
  return {.late = from_seconds(1e-3 * late_ms), .jitter_s = 1e-3 * jitter_ms};
}

void impair(ImuFaults& faults, const Imperfections& all, std::uint64_t seed) {
  faults.stamps = stamp_faults(all.imu_late_ms, all.imu_jitter_ms);
  Dice scale(seed_for(seed, "gyro scale"));
  for (double& error : faults.gyro_axis_scale_error)
    error = 0.01 * all.gyro_scale_percent * either_sign(scale);
  faults.gyro_bias_walk_radps_per_sqrt_s =
      std::hypot(faults.gyro_bias_walk_radps_per_sqrt_s, kRadPerDeg * all.gyro_walk_dps);
  // Random rotation: the error has the same magnitude for any direction of the force, and a random direction.
  Dice turned(seed_for(seed, "g-sensitivity"));
  const Eigen::Vector3d axis = any_direction(turned);
  faults.gyro_g_sensitivity_sm = kRadPerDeg * all.g_sensitivity_dps / kGravity_mps2 *
                                 so3_exp(turned.between(0, std::numbers::pi) * axis).toRotationMatrix();
  faults.vibration_mps2 = std::hypot(faults.vibration_mps2, all.vibration_mps2);
}

void impair(NamedLidar& lidar, const Imperfections& all, std::uint64_t seed) {
  SyntheticLidarOptions& options = lidar.options;
  displace(options.T_base_lidar, lidar.T_base_configured, all, seed_for(seed, "mounting"));
  options.beam_rad = 1e-3 * all.beam_mrad;
  options.laser_bias_m = 1e-3 * all.laser_bias_mm;
  options.incidence_bias_m = 1e-3 * all.incidence_bias_mm;
  options.intensity_bias_m = 1e-3 * all.intensity_bias_mm;
  options.laser_elevation_rad = kRadPerDeg * all.laser_elevation_deg;
  if (lidar.imu)
    impair(*lidar.imu, all, seed_for(seed, "imu"));
  if (all.lidar_drift_ppm > 0) {
    options.drift = 1e-6 * all.lidar_drift_ppm;
    options.pps_locked = false;
    options.clock_offset = -from_seconds(Dice(seed_for(seed, "switched on")).between(0, 3600)); // never set by GPS
  }
}

void impair(MountedImu& imu, const Imperfections& all, std::uint64_t seed) {
  displace(imu.T_base_imu, imu.T_base_configured, all, seed_for(seed, "mounting"));
  impair(imu.faults, all, seed);
}

void impair(NamedOdometry& odometry, const Imperfections& all, std::uint64_t seed) {
  OdometryFaults& faults = odometry.faults;
  faults.stamps = stamp_faults(all.odometry_late_ms, all.odometry_jitter_ms);
  if (faults.spinning_mps == 0) // not based on wheels or feet
    return;
  faults.slip_bursts_per_min = all.slip_bursts_per_min;
  Dice sign(seed_for(seed, "yaw error"));
  faults.turn_error += 0.01 * all.yaw_error_percent * either_sign(sign);
}

} // namespace

Robot impaired(Robot robot, const Imperfections& imperfections, std::uint64_t seed) {
  RobotOptions& sensors = robot.sensors;
  Dice parts_dice(seed_for(seed, "body parts"));
  const Eigen::Vector3d first_m = sensors.lidars.front().options.T_base_lidar.translation;
  const OwnParts parts = own_parts(static_cast<int>(imperfections.body_parts), first_m, parts_dice);
  sensors.body_box = parts.body_box;
  for (NamedLidar& lidar : sensors.lidars) {
    lidar.options.own_parts = parts.surfaces;
    impair(lidar, imperfections, seed_for(seed, lidar.name));
  }
  if (sensors.imu)
    impair(*sensors.imu, imperfections, seed_for(seed, "imu"));
  for (NamedOdometry& odometry : sensors.odometry)
    impair(odometry, imperfections, seed_for(seed, odometry.name));
  return robot;
}

} // namespace locus::sim

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

namespace locus::sim {

/// Imperfections of real robots, each in its physical unit; none by default. The seed determines directions, signs and
/// times that are not given. The manual page of locus-sim lists usual values and their sources.
struct Imperfections {
  // Mounting: config.yaml has the nominal extrinsics, the true ones differ.
  double mounting_deg = 0; ///< rotation of each lidar and the IMU
  double mounting_mm = 0;  ///< and their displacement

  // Time.
  double imu_late_ms = 0;      ///< lateness of the IMU's stamps
  double imu_jitter_ms = 0;    ///< their standard deviation
  double odometry_late_ms = 0; ///< same for every odometry source
  double odometry_jitter_ms = 0;
  double lidar_drift_ppm = 0; ///< the lidars' clocks run fast by this, without GPS

  // Ranges and directions of the lidars.
  double beam_mrad = 0;           ///< full divergence: at an edge the range lies between both surfaces (mixed pixels)
  double laser_bias_mm = 0;       ///< standard deviation of each laser's constant range error
  double incidence_bias_mm = 0;   ///< range error on a surface at 75 degrees of incidence
  double intensity_bias_mm = 0;   ///< range error on black relative to white
  double laser_elevation_deg = 0; ///< standard deviation of each laser's constant elevation error
  double body_parts = 0;          ///< parts of the robot that its lidars see: one inside the body box, one outside, ...

  // Motion sources.
  double slip_bursts_per_min = 0; ///< wheels or feet slip for 0.5 to 2 s, and the odometry reports false motion
  double yaw_error_percent = 0;   ///< scale error of the turns of odometry, of either sign
  double gyro_scale_percent = 0;  ///< scale error of each gyro axis, of either sign
  double gyro_walk_dps = 0;       ///< random walk of the gyro's bias, deg/s per square root of a second
  double g_sensitivity_dps = 0;   ///< deg/s of gyro error per g of specific force
  double vibration_mps2 = 0;      ///< additional noise of the accelerometer in motion

  // Surroundings.
  double people = 0;            ///< who stand and walk 0.5 to 3 m from the robot and accompany it
  double vehicle_s_per_min = 0; ///< time for which a vehicle drives alongside at the robot's speed
  double steam_per_min = 0;     ///< bursts of dust or steam near the path, lasting seconds
  double wet_floor_percent = 0; ///< reflecting share of level ground
  double glass_percent = 0;     ///< reflecting share of upright surfaces
};

/// Imperfection with its name on the command line, and its size on an ordinary robot and in hard use.
struct NamedImperfection {
  std::string_view name;
  double Imperfections::*size;
  double real, harsh;
  double most; ///< upper limit
  std::string_view unit, what;
  bool whole = false; ///< integer
};

inline constexpr std::array kImperfections{
    NamedImperfection{"mounting-deg", &Imperfections::mounting_deg, 0.5, 1.5, 10, "DEG",
                      "Rotation of lidars and IMU from their mounting in config.yaml"},
    NamedImperfection{"mounting-mm", &Imperfections::mounting_mm, 10, 30, 1000, "MM",
                      "Offset of lidars and IMU from their mounting in config.yaml"},
    NamedImperfection{"imu-late-ms", &Imperfections::imu_late_ms, 5, 15, 1000, "MS",
                      "Lateness of the stamps of the IMU"},
    NamedImperfection{"imu-jitter-ms", &Imperfections::imu_jitter_ms, 0.5, 2, 100, "MS",
                      "Jitter of the stamps of the IMU, standard deviation"},
    NamedImperfection{"odometry-late-ms", &Imperfections::odometry_late_ms, 20, 60, 1000, "MS",
                      "Lateness of the stamps of odometry"},
    NamedImperfection{"odometry-jitter-ms", &Imperfections::odometry_jitter_ms, 2, 8, 100, "MS",
                      "Jitter of the stamps of odometry, standard deviation"},
    NamedImperfection{"lidar-drift-ppm", &Imperfections::lidar_drift_ppm, 60, 100, 400, "PPM",
                      "Drift of the clocks of the lidars, which have no GPS"},
    NamedImperfection{"beam-mrad", &Imperfections::beam_mrad, 3, 4.5, 20, "MRAD",
                      "Beam divergence: mixed pixels at edges"},
    NamedImperfection{"laser-bias-mm", &Imperfections::laser_bias_mm, 8, 20, 200, "MM",
                      "Range error of each laser, standard deviation"},
    NamedImperfection{"incidence-bias-mm", &Imperfections::incidence_bias_mm, 10, 30, 500, "MM",
                      "Range error at 75 degrees of incidence"},
    NamedImperfection{"intensity-bias-mm", &Imperfections::intensity_bias_mm, 10, 25, 500, "MM",
                      "Range error of black relative to white surfaces"},
    NamedImperfection{"laser-elevation-deg", &Imperfections::laser_elevation_deg, 0.05, 0.15, 2, "DEG",
                      "Elevation error of each laser, standard deviation"},
    NamedImperfection{"body-parts", &Imperfections::body_parts, 2, 4, 8, "N",
                      "Parts of the robot in view, alternately inside and outside the body box", true},
    NamedImperfection{"slip-bursts-per-min", &Imperfections::slip_bursts_per_min, 2, 8, 60, "N",
                      "Number of slips of wheels or feet, half a second to two seconds each"},
    NamedImperfection{"yaw-error-percent", &Imperfections::yaw_error_percent, 4, 10, 50, "PERCENT",
                      "Scale error of the turns of odometry"},
    NamedImperfection{"gyro-scale-percent", &Imperfections::gyro_scale_percent, 0.5, 2, 20, "PERCENT",
                      "Scale error of the gyro's axes"},
    NamedImperfection{"gyro-walk-dps", &Imperfections::gyro_walk_dps, 0.005, 0.02, 1, "DPS",
                      "Random walk of the gyro's bias, per square root of a second"},
    NamedImperfection{"g-sensitivity-dps", &Imperfections::g_sensitivity_dps, 0.05, 0.2, 5, "DPS",
                      "Sensitivity of the gyro to specific force, per g"},
    NamedImperfection{"vibration-mps2", &Imperfections::vibration_mps2, 1.5, 5, 100, "MPS2",
                      "Noise of the accelerometer while the robot moves"},
    NamedImperfection{"people", &Imperfections::people, 3, 6, 20, "N",
                      "Number of people who stand and walk 0.5 to 3 m from the robot and follow it", true},
    NamedImperfection{"vehicle-s-per-min", &Imperfections::vehicle_s_per_min, 5, 20, 60, "S",
                      "Seconds of each minute for which a vehicle drives alongside"},
    NamedImperfection{"steam-per-min", &Imperfections::steam_per_min, 1, 6, 60, "N",
                      "Number of clouds of dust or steam near the path, each for some seconds"},
    NamedImperfection{"wet-floor-percent", &Imperfections::wet_floor_percent, 3, 20, 100, "PERCENT",
                      "Share of the floor that reflects like a mirror"},
    NamedImperfection{"glass-percent", &Imperfections::glass_percent, 2, 10, 100, "PERCENT",
                      "Share of walls that reflect like a mirror"}};

/// Level of realism: clean, without imperfections; as on real robots; or harsh.
enum class Realism : std::uint8_t { clean, real, harsh };

inline constexpr std::array<std::string_view, 3> kRealismNames{"clean", "real", "harsh"}; ///< indexed by Realism

Imperfections imperfections_of(Realism realism);

} // namespace locus::sim

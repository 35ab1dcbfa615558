// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <ostream>
#include <string>
#include <vector>

namespace locus::test {

/// A replay with its accepted trace, traces/COURSE/NAME.txt.
struct Drive {
  std::string name;
  std::string options;            ///< of locus-replay
  bool on_other_isas_too = false; ///< compared within the tolerance
};

/// A course simulated by locus-sim once for all its drives.
struct SimulatedCourse {
  std::string name;
  std::string options; ///< of locus-sim
  std::vector<Drive> drives;
};
inline void PrintTo(const SimulatedCourse& course, std::ostream* stream) { *stream << course.options; }

/// A real recording below the folder of real data.
struct RealRecording {
  std::string name; ///< traces/real/NAME.txt
  std::string path;
  bool on_other_isas_too = false;
};
inline void PrintTo(const RealRecording& recording, std::ostream* stream) { *stream << recording.path; }

inline const std::string kNoSources = "--set motion_sources=[]";

/// Every world and robot, one and two lidars, with and without motion sources, and every kind of fault in a clean
/// world; some drives with realistic imperfections.
inline const std::vector<SimulatedCourse> kCourses{
    {"urban_husky",
     "--realism clean --world urban --robot husky --duration 30 --seed 1",
     {{"all_sources", "", true},
      {"lidar_alone", kNoSources, true},
      {"lidar_lost", "--fail top:lost@8-12"},
      {"lidar_clock_step", "--fail top:clock-step=600@8-14"},
      {"wio_jump_imu_nan", "--fail wio:jump=2@8-14 --fail imu:nan@8-14"},
      {"all_corrupt", "--fail top:corrupt=10@4-12 --fail imu:corrupt=10@14-20 --fail wio:corrupt=10@16-22"}}},
    {"tunnel_husky_two_lidars",
     "--realism clean --world tunnel --robot husky --lidars 2 --duration 30 --seed 1",
     {{"all_sources", "", true},
      {"lidars_alone", kNoSources},
      {"front_frozen", "--fail front:frozen@8-14"},
      {"packets_lost_reordered_duplicated",
       "--fail top:packet-loss=10@4-16 --fail front:reorder=10@4-16 --fail all-lidars:duplicate=10@8-12"}}},
    {"corridor_husky",
     "--realism clean --world corridor --robot husky --duration 30 --seed 1",
     {{"all_sources", "", true},
      {"lidar_and_imu", "--fail wio:lost@0"},
      {"wio_frozen_then_uncertain", "--fail wio:frozen@6-10 --fail wio:covariance=10@12-18"}}},
    {"field_spot",
     "--realism clean --world field --robot spot --duration 30 --seed 1",
     {{"all_sources", "", true}, {"vio_late_kio_nan", "--fail vio:late=0.3@6-14 --fail kio:nan@10-18"}}},
    {"stairs_spot_two_lidars",
     "--realism clean --world stairs --robot spot --lidars 2 --duration 30 --seed 1",
     {{"all_sources", "", true}, {"lidars_and_imu", "--fail vio:lost@0 --fail kio:lost@0"}}},
    {"urban_husky_real",
     "--realism real --world urban --robot husky --duration 30 --seed 1",
     {{"all_sources", "", true}, {"lidar_alone", kNoSources}}},
    {"urban_handheld_real",
     "--realism real --world urban --robot handheld --duration 20 --seed 1",
     {{"lidar_and_imu", ""}}},
    {"road_car_real", "--realism real --world road --robot car --duration 20 --seed 1", {{"all_sources", ""}}},
};

/// Recordings with more than one sweep. Each that locus-replay can read has an accepted trace.
inline const std::vector<RealRecording> kRecordings{
    {"hdl32e_moving", "velodyne/hdl32e_moving_15mps.pcap", true},
    {"hdl32e_static_monterey", "velodyne/hdl32e_static_monterey.pcap", true},
    {"vlp16_static_1200rpm", "velodyne/vlp16_static_1200rpm_product21.pcap", true},
    {"vlp16_static_gps_pps", "velodyne/vlp16_static_gps_pps.pcap", true},
    {"vls128_static", "velodyne/vls128"}, // chaotic: a different last bit gives another estimate
    {"trial_plant", "trial/plant"},
    {"trial_people", "trial/people"},
    {"trial_corridor", "trial/corridor"},
    {"trial_spot", "trial/spot"},
};

} // namespace locus::test

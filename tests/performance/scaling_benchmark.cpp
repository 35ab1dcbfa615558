// SPDX-License-Identifier: Apache-2.0
// Scaling of cost and memory with the points of a sweep, the lidars, the map and the threads.
#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "core/map/registration.hpp"
#include "suite.hpp"

namespace locus::performance {

namespace {

using Captures = std::vector<std::unique_ptr<const Capture>>;

std::unique_ptr<const Capture> drive(const std::string& name, const sim::SensorChoice& sensors, Duration duration) {
  SimulatedRobot robot(sim::make_urban, sensors, duration);
  return std::make_unique<const Capture>(name, robot);
}

void add_lidars(const Effort& effort, Captures& captures) {
  for (int lidars = 1; lidars <= 3; ++lidars)
    captures.push_back(drive("vlp16_" + std::to_string(lidars), {.lidars = lidars}, effort.drive()));
  captures.push_back(drive("vls128_1", {.model = velodyne::Model::vls128}, effort.short_drive()));
  for (const auto& capture : captures) {
    add_pipeline("lidars/" + capture->name() + "/lidar", effort, *capture, capture->config_of_lidar_alone());
    add_pipeline("lidars/" + capture->name() + "/wheels_gyro", effort, *capture, capture->config());
  }
}

/// Requires a lidar with enough returns for all sizes.
void add_points(const Effort& effort, const Capture& capture) {
  for (const std::size_t points : std::array<std::size_t, 7>{500, 1'000, 2'000, 5'000, 10'000, 20'000, 60'000}) {
    Config alone = capture.config_of_lidar_alone(), aided = capture.config();
    alone.sweep.segment_filter.points = aided.sweep.segment_filter.points = points;
    const std::string name = "points/" + std::to_string(points);
    add_pipeline(name + "/lidar", effort, capture, alone);
    add_pipeline(name + "/wheels_gyro", effort, capture, aided);
  }
}

/// A sweep inserted into the map, and its registered pose.
struct PlacedSweep {
  std::vector<SurfacePoint> scan;
  std::size_t registered;
  Pose T_odom_base;
};
using PlacedSweeps = std::vector<PlacedSweep>;

std::shared_ptr<const PlacedSweeps> keyframes_of(const Capture& capture, const Config& config) {
  auto sweeps = std::make_shared<PlacedSweeps>();
  Playback playback(capture, config);
  while (const daemon::ProcessedSweep* sweep = playback.next()) {
    const auto scan = playback.pipeline().odometry().scan();
    if (sweep->estimate.keyframe)
      sweeps->push_back({{scan.begin(), scan.end()}, sweep->estimate.points, sweep->estimate.T_odom_base});
  }
  return sweeps;
}

/// Inserts the sweeps from `begin` on, displaced by `away_m`.
std::size_t insert_all(const PlacedSweeps& sweeps, const Eigen::Vector3d& away_m, std::size_t most_points,
                       SurfaceMap& map) {
  std::size_t points = 0;
  for (const PlacedSweep& sweep : sweeps) {
    if (points >= most_points)
      break;
    Pose T_map_base = sweep.T_odom_base;
    T_map_base.translation += away_m;
    map.insert(sweep.scan, T_map_base);
    points += sweep.scan.size();
  }
  return points;
}

/// Inserts displaced copies of the drive, a lidar range apart, until the map has this number of points; the robot's own
/// surroundings come last.
std::size_t fill(const PlacedSweeps& sweeps, std::size_t wanted, SurfaceMap& map) {
  constexpr double kApart_m = 200.0;
  constexpr std::size_t kPerRow = 32;
  std::size_t whole = 0;
  for (const PlacedSweep& sweep : sweeps)
    whole += sweep.scan.size();
  std::size_t points = 0;
  const auto away_m = [&](std::size_t copy) {
    const std::size_t row = copy / kPerRow;
    return Eigen::Vector3d{kApart_m * static_cast<double>(copy % kPerRow), kApart_m * static_cast<double>(row), 0.0};
  };
  for (std::size_t copy = 1; points + whole < wanted; ++copy)
    points += insert_all(sweeps, away_m(copy), wanted - whole - points, map);
  return points + insert_all(sweeps, Eigen::Vector3d::Zero(), wanted - points, map);
}

Registration align(Gicp& gicp, const PlacedSweep& sweep, const SurfaceMap& map) {
  constexpr double kOff_m = 0.02;
  Pose T_start = sweep.T_odom_base;
  T_start.translation.x() += kOff_m;
  return gicp.align({std::span(sweep.scan).first(sweep.registered)}, map, T_start, {T_start},
                    OdometryOptions{}.scan_to_submap, false, [] { return false; });
}

/// Registers sweeps of one place in turn with ever larger maps around it, and then inserts them again.
void register_in_map(benchmark::State& state, const PlacedSweeps& sweeps, std::size_t points, std::size_t max_bytes) {
  constexpr std::size_t kInsertions = 100;
  SurfaceMap map(max_bytes);
  state.counters["map_points"] = static_cast<double>(fill(sweeps, points, map));
  state.counters["voxels"] = static_cast<double>(map.fine().size() + map.coarse().size());
  const std::size_t inside = std::clamp<std::size_t>(points / sweeps.front().scan.size(), 1, sweeps.size());
  Gicp gicp(1);
  std::size_t sweep = 0;
  for (auto _ : state)
    benchmark::DoNotOptimize(align(gicp, sweeps[sweep++ % inside], map));
  const daemon::MachineTime begin = daemon::MachineTime::now();
  for (std::size_t i = 0; i < kInsertions; ++i)
    map.insert(sweeps[i % inside].scan, sweeps[i % inside].T_odom_base);
  const daemon::MachineTime inserting = daemon::MachineTime::now() - begin;
  state.counters["insert_ms"] = 1e3 * to_seconds(inserting.cpu) / static_cast<double>(kInsertions);
}

void add_maps(const Effort& effort, const std::shared_ptr<const PlacedSweeps>& sweeps) {
  constexpr std::size_t kRegistrations = 400;
  constexpr std::size_t kAsItShips_mb = 100, kLarge_mb = 1'000;
  const std::size_t most = effort.smoke ? 100'000 : 10'000'000;
  for (const std::size_t megabytes : {kAsItShips_mb, kLarge_mb}) {
    if (effort.smoke && megabytes == kLarge_mb)
      continue;
    for (std::size_t points = 10'000; points <= most; points *= 10)
      add("map/" + std::to_string(megabytes) + '/' + std::to_string(points), effort, kRegistrations,
          [=](auto& state) { register_in_map(state, *sweeps, points, megabytes * 1'000'000); });
  }
}

/// Wall time: the threads share the work.
void register_with_threads(benchmark::State& state, const PlacedSweeps& sweeps, int threads) {
  SurfaceMap map(MapOptions{}.max_bytes);
  insert_all(sweeps, Eigen::Vector3d::Zero(), ~std::size_t{0}, map);
  Gicp gicp(threads);
  std::size_t sweep = 0;
  for (auto _ : state)
    benchmark::DoNotOptimize(align(gicp, sweeps[sweep++ % sweeps.size()], map));
}

/// Scalability of the machine: the same sum by one thread or several.
void spin(benchmark::State& state, int threads) {
  constexpr std::size_t kTurns = 20'000'000;
  const auto turn = [share = kTurns / static_cast<std::size_t>(threads)] {
    std::uint64_t random = 1;
    for (std::size_t i = 0; i < share; ++i)
      benchmark::DoNotOptimize(random = random * 6'364'136'223'846'793'005U + 1);
  };
  for (auto _ : state) {
    std::vector<std::jthread> helpers;
    for (int helper = 1; helper < threads; ++helper)
      helpers.emplace_back(turn);
    turn();
  }
}

void add_threads(const Effort& effort, const Capture& capture) {
  constexpr std::size_t kRegistrations = 200, kSpins = 20;
  for (const std::size_t points : std::array<std::size_t, 2>{2'000, 10'000}) {
    Config config = capture.config();
    config.sweep.segment_filter.points = points;
    const auto sweeps = keyframes_of(capture, config);
    for (int threads = 1; threads <= 4; ++threads)
      add("threads_register/" + std::to_string(points) + '/' + std::to_string(threads), effort, kRegistrations,
          [=](auto& state) { register_with_threads(state, *sweeps, threads); })
          ->UseRealTime();
  }
  for (int threads = 1; threads <= 4; ++threads)
    add("threads_spin/0/" + std::to_string(threads), effort, kSpins, [=](auto& state) {
      spin(state, threads);
    })->UseRealTime();
}

} // namespace

void add_scaling(const Effort& effort) {
  static Captures captures; // as long as the benchmarks run
  add_lidars(effort, captures);
  const Capture& one_vlp16 = *captures.front();
  const Capture& vls128 = *captures.back();
  add_points(effort, vls128);
  add_maps(effort, keyframes_of(one_vlp16, one_vlp16.config()));
  add_threads(effort, vls128);
}

} // namespace locus::performance

// SPDX-License-Identifier: Apache-2.0
#include "closed_course.hpp"

#include <chrono>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "drivers/velodyne/model.hpp"
#include "locus_sim/capture_writer.hpp"
#include "locus_sim/driver.hpp"
#include "locus_sim/robot.hpp"
#include "locus_sim/world.hpp"

namespace locus::soak {

namespace {

constexpr std::uint64_t kSeed = 1;
constexpr double kStanding = 0.1; ///< fraction of a lap

Duration whole_packets(Duration about) {
  constexpr int kOfWholeMicroseconds = 125;
  const Duration unit =
      kOfWholeMicroseconds * velodyne::packet_duration(velodyne::Model::vlp16, velodyne::ReturnMode::strongest);
  return std::llround(to_seconds(about) / to_seconds(unit)) * unit;
}

sim::Robot robot(Duration lap) {
  sim::Robot husky = sim::make_husky({}, kSeed);
  for (sim::NamedLidar& lidar : husky.sensors.lidars)
    lidar.options.rpm = std::round(10.0 * to_seconds(lap)) * 60.0 / to_seconds(lap);
  husky.sensors.imu->faults.gyro_bias_walk_radps_per_sqrt_s = 0.0;
  husky.sensors.imu->faults.attitude_wander_rad = 0.0;
  return husky;
}

sim::Trajectory there_and_back(const sim::World& world, const sim::Robot& robot, Duration lap) {
  sim::Dice dice(kSeed);
  const double turning_s = 2.0 * (std::numbers::pi / robot.agility.turn_rate_radps + 1.0);
  const double driving_s = (1.0 - kStanding) * to_seconds(lap) - turning_s;
  sim::PlannedCourse planned = sim::plan_course(world.roads, robot.agility, from_seconds(driving_s / 2.0), dice);
  planned.course.back(robot.agility.turn_rate_radps);
  sim::Ride ride = robot.ride;
  ride.ground_m = world.ground_m;
  return sim::Trajectory(planned.course, planned.start, {}, ride);
}

} // namespace

ClosedCourse closed_course(const std::filesystem::path& folder, Duration about) {
  const Duration lap = whole_packets(about);
  if (std::filesystem::exists(folder))
    return {folder, lap};
  // The last packet arrives after its firings and the network latency, the next one a packet later.
  constexpr Duration kOnItsWay = std::chrono::milliseconds{1};
  const std::filesystem::path beside = folder.string() + ".new";
  std::filesystem::remove_all(beside);
  const sim::World world = sim::make_urban(kSeed);
  const sim::Robot husky = robot(lap);
  sim::write_capture_folder(beside, world.scene, there_and_back(world, husky, lap), lap + kOnItsWay, husky.sensors);
  std::filesystem::rename(beside, folder);
  return {folder, lap};
}

} // namespace locus::soak

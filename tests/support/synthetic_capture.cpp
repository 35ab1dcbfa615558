// SPDX-License-Identifier: Apache-2.0
// synthetic-capture: drives a synthetic robot through a synthetic place and writes a capture folder with exact truth.
#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <cstdio>
#include <exception>
#include <map>
#include <string>

#include "locus_sim/capture_folder_writer.hpp"
#include "support/scenes.hpp"

namespace locus::sim {
namespace {

struct Arguments {
  std::string place;
  double seconds = 0;
  std::filesystem::path folder;
  double speed_mps = 1.0;
  velodyne::Model model = velodyne::Model::vlp16;
  double rpm = 600;
  int lidars = 1;
  std::uint64_t seed = 1;
  bool dual = false, no_noise = false, no_imu = false, no_odometry = false;

  [[nodiscard]] Duration duration() const { return from_seconds(seconds); }
};

struct World {
  Scene scene;
  Trajectory trajectory;
};

World straight_world(Scene scene, const Arguments& arguments, double aside_m, double wave_m, const Terrain& terrain) {
  return {std::move(scene), Trajectory(weaving_course(arguments.duration(), arguments.speed_mps, aside_m, wave_m),
                                       weaving_start(5, aside_m, wave_m), terrain)};
}

using WorldMaker = World (*)(const Arguments&);

const std::map<std::string, WorldMaker>& places() {
  static constexpr Terrain kFloor{.height_m = 0.005, .tilt_rad = 0.005, .wavelength_m = 3};
  static constexpr Terrain kRubble{.height_m = 0.03, .tilt_rad = 0.02, .wavelength_m = 3};
  static constexpr Terrain kAsphalt{.height_m = 0.02, .tilt_rad = 0.003, .wavelength_m = 25};
  static constexpr auto kLength_m = [](const Arguments& a) { return a.seconds * a.speed_mps + 30; };
  static const std::map<std::string, WorldMaker> makers{
      {"plant",
       [](const Arguments& a) {
         return World{plant(), Trajectory(plant_course(a.duration(), a.speed_mps), plant_start(), kFloor)};
       }},
      {"room",
       [](const Arguments& a) {
         return World{room(), Trajectory(room_course(a.duration(), a.speed_mps), room_start(), kFloor)};
       }},
      {"corridor", [](const Arguments& a) { return straight_world(corridor(kLength_m(a)), a, 0.3, 12, kFloor); }},
      {"bare-corridor",
       [](const Arguments& a) { return straight_world(corridor(kLength_m(a), Walls::bare), a, 0.3, 12, kFloor); }},
      {"tunnel", [](const Arguments& a) { return straight_world(tunnel(kLength_m(a), a.seed), a, 0.5, 20, kRubble); }},
      {"street",
       [](const Arguments& a) { return straight_world(street(kLength_m(a), a.seed), a, 1.0, 160, kAsphalt); }},
  };
  return makers;
}

/// Where the lidars sit on a Husky: one level, one ahead of it pitched down by 30 degrees.
NamedLidar mounted_lidar(int index, const Arguments& arguments) {
  NamedLidar lidar;
  lidar.options.model = arguments.model;
  lidar.options.return_mode = arguments.dual ? velodyne::ReturnMode::dual : velodyne::ReturnMode::strongest;
  lidar.options.rpm = arguments.rpm;
  lidar.options.T_base_lidar.translation = {0.1, 0, 0.75};
  lidar.options.range_noise_m = arguments.no_noise ? 0 : 0.01;
  lidar.options.dropout = arguments.no_noise ? 0 : 0.01;
  lidar.options.sends_position_packets = true;
  lidar.options.seed = arguments.seed + static_cast<std::uint64_t>(index);
  if (index > 0) {
    constexpr double kPitch_rad = 0.523598775598;
    lidar.name = "tilted";
    lidar.options.T_base_lidar = {from_rpy_rad({0, kPitch_rad, 0}), {0.35, 0, 0.65}};
    lidar.options.port += 1;
    lidar.options.source_ip += 1;
    lidar.options.first_azimuth_deg = 117;
  }
  return lidar;
}

RobotOptions robot(const Arguments& arguments) {
  RobotOptions options{.lidars = {}, .seed = arguments.seed};
  for (int index = 0; index < arguments.lidars; ++index)
    options.lidars.push_back(mounted_lidar(index, arguments));
  if (!arguments.no_noise) {
    options.imu->faults = {.gyro_bias_radps = {0.001, -0.0015, 0.002},
                            .gyro_noise_radps = 0.003,
                            .accelerometer_bias_mps2 = {0.02, -0.01, 0.03},
                            .accelerometer_noise_mps2 = 0.05,
                            .attitude_noise_rad = 0.003};
    options.odometry.front().faults = {
        .scale_error = 0.01, .yaw_drift_rad_per_m = 0.001, .noise_m_per_sqrt_m = 0.005, .noise_rad_per_sqrt_m = 0.003};
  }
  if (arguments.no_imu)
    options.imu.reset();
  if (arguments.no_odometry)
    options.odometry.clear();
  return options;
}

void describe(CLI::App& app, Arguments& arguments) {
  std::vector<std::string> names, models;
  for (const auto& [name, maker] : places())
    names.push_back(name);
  for (const velodyne::Model model : velodyne::kModels)
    models.emplace_back(to_string(model));
  const auto set_model = [&](const std::string& name) { arguments.model = *velodyne::model_from_string(name); };

  app.add_option("PLACE", arguments.place, "Where the robot drives")->required()->check(CLI::IsMember(names));
  app.add_option("SECONDS", arguments.seconds, "How long")->required()->check(CLI::Range(0.1, 100'000.0));
  app.add_option("FOLDER", arguments.folder, "Capture folder to write")->required();
  app.add_option("--speed", arguments.speed_mps, "m/s")->capture_default_str()->check(CLI::Range(0.1, 40.0));
  app.add_option_function<std::string>("--model", set_model, "Of the lidar")->check(CLI::IsMember(models));
  app.add_flag("--dual", arguments.dual, "Dual return mode");
  app.add_option("--rpm", arguments.rpm, "Of the lidar")->capture_default_str()->check(CLI::Range(300.0, 1200.0));
  app.add_option("--lidars", arguments.lidars, "1 level, 2 with one pitched down as well")->check(CLI::Range(1, 2));
  app.add_option("--seed", arguments.seed, "Of the noise and of the place")->capture_default_str();
  app.add_flag("--no-noise", arguments.no_noise, "Perfect sensors");
  app.add_flag("--no-imu", arguments.no_imu, "Leaves imu.csv out");
  app.add_flag("--no-odometry", arguments.no_odometry, "Leaves wio.tum out");
  app.footer("Example: synthetic-capture plant 60 /tmp/plant");
}

void run(const Arguments& arguments) {
  const World world = places().at(arguments.place)(arguments);
  write_capture_folder(arguments.folder, world.scene, world.trajectory, arguments.duration(), robot(arguments));
}

} // namespace
} // namespace locus::sim

// Only the printing of an error could throw here, and there is nobody left to tell.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  CLI::App app{"Writes what the sensors of a synthetic robot see, with the exact truth, as a capture folder."};
  locus::sim::Arguments arguments;
  try {
    describe(app, arguments);
    app.parse(argc, argv);
    run(arguments);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  } catch (const std::invalid_argument& error) {
    fmt::print(stderr, "synthetic-capture: {}; try another speed\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    fmt::print(stderr, "synthetic-capture: {}\n", error.what());
    return 1;
  }
  return 0;
}

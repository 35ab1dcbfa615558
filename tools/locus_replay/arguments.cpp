// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/arguments.hpp"

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "command_line.hpp"
#include "locus_replay/failure.hpp"
#include "locus_replay/number_between.hpp"

namespace locus::tools {
namespace {

Arguments::OdometryFile parse_odometry(const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == 0 || equals == std::string::npos || equals + 1 == text.size())
    throw Failure(ExitStatus::wrong_usage,
                  fmt::format("--odometry {}: must be NAME=FILE, for example wio=wheels.tum", text));
  return {text.substr(0, equals), text.substr(equals + 1)};
}

} // namespace

std::optional<Arguments> parse_arguments(int argc, char** argv) {
  Arguments arguments;
  std::vector<std::string> odometry, faults;
  int threads = 0;
  double start_s = 0, duration_s = 0;
  std::string speed; // as text: CLI11 accepts only integers for a flag with a value
  constexpr auto formats = names_of(CloudFormat{});
  std::string format{formats.front()};

  CLI::App app{"Replays recorded lidar data and writes odometry, map and figures.", "locus-replay"};
  app.add_option(
         "CAPTURE", arguments.capture,
         "A pcap or pcapng file, packed or not, - for standard input; a ROS 1 bag; MCAP; a ROS 2 bag, its folder "
         "or a .db3 file; a drive of KITTI's raw data or odometry benchmark; a folder of sweeps (.pcd, .bin) with "
         "times; or a folder with lidar.pcap and any of imu.csv, NAME.tum, config.yaml, gt.tum, gt_map.ply")
      ->required();
  app.add_option("-o,--output", arguments.output,
                 "Folder for odometry.tum, odometry.csv, map.pcd, report.html and summary.json; created if missing")
      ->type_name("DIR");
  app.add_flag("--discover", arguments.discover,
               "Prints the configuration that fits the recording, YAML for --config with the reason for each line; "
               "replays nothing");
  app.add_option("-c,--config", arguments.config, "Configuration; default: the folder's config.yaml, else defaults")
      ->type_name("FILE");
  app.add_option("--set", arguments.overrides,
                 "Overrides one key of the configuration, e.g. lidars.0.port=2369; may be repeated")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);
  app.add_option("--imu", arguments.imu, "Samples of the motion source of kind imu, CSV in the format of EuRoC")
      ->type_name("FILE");
  app.add_option("--odometry", odometry, "Poses of the motion source NAME, in TUM format; may be repeated")
      ->type_name("NAME=FILE")
      ->allow_extra_args(false);
  app.add_option("--ground-truth", arguments.ground_truth,
                 "True poses for comparison with the odometry, in TUM format; default: the folder's gt.tum")
      ->type_name("FILE");
  app.add_option("--map-truth", arguments.map_truth,
                 "True map for comparison with the map, PLY or PCD; default: the folder's gt_map.ply")
      ->type_name("FILE");
  auto* mcap = app.add_option("--mcap", arguments.mcap,
                              "Also writes odometry, tf, corrected clouds, diagnostics and the inputs as ROS 2 "
                              "messages to FILE, for Foxglove and rosbag2")
                   ->type_name("FILE");
  auto* sweeps =
      app.add_option("--sweeps", arguments.sweeps,
                     "Also writes all returns of each sweep, corrected for motion, as files to DIR, a new or empty "
                     "folder, with times.txt and poses.txt")
          ->type_name("DIR");
  auto* calibrate =
      app.add_option("--calibrate", arguments.calibrate,
                     "Replays several times, estimates the lateness and the mounting of an IMU and the scales of "
                     "wheels, uses them in the run and writes them to FILE, YAML for the configuration")
          ->type_name("FILE");
  app.add_option("--sweeps-format", format, "Format of the files of --sweeps: pcd, ply or bin (KITTI's); default: pcd")
      ->type_name("FORMAT")
      ->check(CLI::IsMember(std::vector<std::string>(formats.begin(), formats.end())))
      ->needs(sweeps);
  app.add_option("--start", start_s, "Skips input that arrived earlier, seconds from the start of the capture")
      ->type_name("S")
      ->check(number_between(0, kLongest_s));
  auto* duration = app.add_option("--duration", duration_s, "Ends the replay after this part of the recording, seconds")
                       ->type_name("S")
                       ->check(number_between(1e-3, kLongest_s));
  auto* threads_option =
      app.add_option("--threads", threads, "Number of threads for registration; does not change the result")
          ->type_name("N")
          ->check(CLI::Range(1, 256));
  app.add_option("--fail", faults,
                 "Injects a fault, NAME:KIND[=VALUE]@T[-T1], e.g. all-lidars:lost@10-20; may be repeated. NAME: a "
                 "lidar, a motion source or all-lidars. KIND: lost, frozen, jump, nan, late, covariance, clock-step, "
                 "packet-loss, reorder, duplicate, view, corrupt. T: seconds from the start of the capture")
      ->type_name("SPEC")
      ->allow_extra_args(false);
  auto* realtime = app.add_flag("--realtime{1}", speed,
                                "Replays at the pace of the recording, or SPEED times it (--realtime=SPEED), in the "
                                "threads of the service; sweeps are dropped if these are too slow")
                       ->check(number_between(0.01, 1000))
                       ->excludes(mcap)
                       ->excludes(sweeps)
                       ->excludes(calibrate);
  app.add_flag(
      "--kitti-as-published", arguments.kitti_as_published,
      "Uses the points of a drive of KITTI as published; default: corrects their vertical angles, which are too "
      "small by 0.205 degrees");
  app.add_flag("--quiet", arguments.quiet, "Prints only warnings and errors");
  app.set_version_flag("--version", "locus-replay " LOCUS_VERSION);
  app.footer("Examples:\n"
             "  locus-replay -o out drive.pcap\n"
             "  locus-replay --discover drive.bag >drive.yaml\n"
             "  locus-replay -c husky.yaml --imu imu.csv --odometry wio=wheels.tum -o out drive.pcap\n"
             "  locus-replay --set motion_sources.wio.topic=/odom -o out drive.bag\n"
             "  locus-replay --set lidars.front.port=2369 --fail front:lost@10-20 -o out robot_folder/");
  if (!parse_command_line(app, argc, argv))
    return std::nullopt;

  if (arguments.output.empty() && !arguments.discover)
    throw Failure(ExitStatus::wrong_usage, "--output is required");
  for (const auto& [is_given, name] :
       {std::pair{!arguments.calibrate.empty(), "--calibrate"}, std::pair{arguments.discover, "--discover"}})
    if (is_given && arguments.capture == "-")
      throw Failure(ExitStatus::wrong_usage,
                    fmt::format("{}: standard input cannot be read several times; name a file", name));
  for (const std::string& text : odometry)
    arguments.odometry.push_back(parse_odometry(text));
  for (const std::string& text : faults)
    arguments.faults.push_back(value_or_fail(Fault::parse(text), ExitStatus::wrong_usage));
  if (threads_option->count() > 0)
    arguments.overrides.push_back(fmt::format("threads={}", threads));
  arguments.sweeps_format = *from_string<CloudFormat>(format);
  arguments.start = from_seconds(start_s);
  if (duration->count() > 0)
    arguments.duration = from_seconds(duration_s);
  if (realtime->count() > 0)
    arguments.realtime_speed = std::stod(speed);
  return arguments;
}

} // namespace locus::tools

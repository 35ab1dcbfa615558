// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/recorded_input.hpp"

#include <algorithm>
#include <cctype>
#include <iterator>
#include <utility>

#include <fmt/format.h>

#include "bags/bag.hpp"
#include "drivers/files/capture_sequence.hpp"
#include "kitti/kitti_drive.hpp"
#include "kitti/kitti_points.hpp"
#include "locus_replay/bag_motion.hpp"
#include "locus_replay/bag_packets.hpp"
#include "locus_replay/bag_topics.hpp"
#include "locus_replay/driver_stamps.hpp"
#include "locus_replay/failure.hpp"
#include "locus_replay/kitti_packets.hpp"
#include "locus_replay/sweep_clouds.hpp"
#include "sweep_folder/sweep_folder.hpp"
#include "unpacking/unpacking_stream.hpp"

namespace locus::tools {
namespace {

/// Returns the values of the lidars by configuration index; nothing for clouds.
std::vector<std::optional<Duration>> recorder_ahead_of_drivers(Bag& bag, const BagTopics& topics) {
  std::vector<std::optional<Duration>> ahead;
  for (const std::optional<std::size_t>& topic : topics.of_lidar)
    ahead.push_back(topic ? recorder_ahead_of_driver(bag, *topic) : std::nullopt);
  return ahead;
}

/// Returns the time between the clocks of the recorder and of the lidars' drivers; zero if it may be that of transit.
Duration clock_difference(const std::vector<std::optional<Duration>>& recorder_ahead) {
  constexpr Duration kLongestTransit = std::chrono::seconds{1};
  const auto known = std::ranges::find_if(recorder_ahead, [](const auto& ahead) { return ahead.has_value(); });
  const Duration ahead = known != recorder_ahead.end() ? **known : Duration{};
  return std::chrono::abs(ahead) > kLongestTransit ? ahead : Duration{};
}

RecordedInput open_bag_input(const Arguments& arguments, const std::filesystem::path& file, const Config& config,
                             bool config_is_users_own, std::vector<std::string>& warnings) {
  std::unique_ptr<Bag> bag = value_or_fail(open_bag(file), ExitStatus::failed);
  std::vector<MotionRecording> motion = read_motion(arguments, {}, config, false, warnings);
  const auto has_file = [&](SourceId source) {
    return std::ranges::find(motion, source, &MotionRecording::source) != motion.end();
  };
  const BagTopics topics = BagTopics::choose(*bag, file.string(), config, has_file);
  std::ranges::copy(topics.doubts, std::back_inserter(warnings));
  const std::vector<std::optional<Duration>> recorder_ahead = recorder_ahead_of_drivers(*bag, topics);
  std::ranges::move(read_bag_motion(*bag, file, topics.of_source, clock_difference(recorder_ahead), warnings),
                    std::back_inserter(motion));
  for (std::size_t i = 0; config_is_users_own && topics.doubts.empty() && i < topics.of_source.size(); ++i) {
    if (!has_file(SourceId{i}) && !config.motion_sources[i].of_lidar)
      warnings.push_back(fmt::format("{}: motion source {}: never received, nothing of its kind in the bag",
                                     file.string(), config.motion_sources[i].name));
  }
  return {std::make_unique<BagPackets>(std::move(bag), file, config, topics, recorder_ahead),
          std::move(motion),
          topics.used,
          {}};
}

RecordedInput open_drive_input(const Arguments& arguments, const std::filesystem::path& folder, const Config& config,
                               std::vector<std::string>& warnings) {
  for (const Fault& fault : arguments.faults) {
    if (std::ranges::any_of(config.lidars, [&](const LidarOptions& lidar) { return fault.strikes_lidar(lidar.name); }))
      throw Failure(ExitStatus::wrong_usage,
                    fmt::format("--fail {}: a drive of KITTI has no packets; choose a motion source", fault.name));
  }
  KittiDrive drive = value_or_fail(KittiDrive::open(folder), ExitStatus::failed);
  RecordedInput input{nullptr, read_motion(arguments, {}, config, false, warnings), "", {}};
  std::ranges::copy(drive.warnings, std::back_inserter(warnings));
  if (!arguments.ground_truth.empty())
    drive.truth.clear();
  for (const StampedPose& pose : drive.truth)
    input.truth.push_back({pose.stamp, pose.T_source_base * config.lidars.front().T_base_lidar.inverse()});
  const std::vector<MotionSource>& sources = config.motion_sources;
  const auto imu = std::ranges::find(sources, SourceKind::imu, &MotionSourceOptions::kind);
  const SourceId source{static_cast<std::size_t>(imu - sources.begin())};
  const bool uses_oxts = !drive.imu.empty() && imu != sources.end() &&
                         std::ranges::find(input.motion, source, &MotionRecording::source) == input.motion.end();
  if (uses_oxts)
    input.motion.push_back({source, folder / "oxts", MotionSamples<ImuSample>(std::move(drive.imu))});
  const double raised_deg = raised_by_deg(arguments).value_or(0);
  input.used = fmt::format("{}: velodyne_points is lidar {}{}{}; {}", folder.string(), config.lidars.front().name,
                           uses_oxts ? ", oxts is " + imu->name : "", input.truth.empty() ? "" : ", oxts is the truth",
                           raised_deg > 0 ? fmt::format("{} degrees are added to its vertical angles", raised_deg)
                                          : "its vertical angles are as published");
  input.lidars = std::make_unique<KittiPackets>(std::move(drive.sweeps), config.lidars.front(), raised_deg);
  return input;
}

RecordedInput open_sweeps_input(const Arguments& arguments, const CaptureFolder& folder, const Config& config,
                                bool config_is_users_own, std::vector<std::string>& warnings) {
  SweepFolder sweeps = value_or_fail(SweepFolder::open(arguments.capture), ExitStatus::failed);
  RecordedInput input{nullptr, read_motion(arguments, folder, config, config_is_users_own, warnings), "", {}};
  const LidarOptions& lidar = config.lidars.front();
  if (!arguments.ground_truth.empty())
    sweeps.truth.clear();
  for (const StampedPose& pose : sweeps.truth)
    input.truth.push_back(
        {pose.stamp, sweeps.is_kitti ? pose.T_source_base * lidar.T_base_lidar.inverse() : pose.T_source_base});
  const double raised_deg = raised_by_deg(arguments).value_or(0);
  input.used =
      fmt::format("{}: {} is lidar {}", arguments.capture.string(), sweeps.folder.filename().string(), lidar.name);
  for (const MotionRecording& motion : input.motion)
    input.used += fmt::format(", {} is {}", motion.file.string(), config.motion_sources[index_of(motion.source)].name);
  if (!input.truth.empty())
    input.used += sweeps.is_kitti ? ", the poses of KITTI are the truth" : ", the estimated states are the truth";
  if (lidar.point_times == PointTimesFrom::none)
    input.used += "; the points of a sweep are treated as of one instant";
  if (raised_deg > 0)
    input.used += fmt::format("; {} degrees are added to their vertical angles", raised_deg);
  input.lidars = std::make_unique<SweepClouds>(std::move(sweeps), raised_deg);
  return input;
}

/// Returns the file behind the named one in a row whose names do not show that it is one capture: tcpdump -C with -W,
/// or with a name without .pcap. After an overwritten part the row starts anywhere.
std::optional<std::filesystem::path> part_beside(const std::filesystem::path& named) {
  const std::string name = named.filename().string();
  const std::string stem = name.substr(0, name.find_last_not_of('0') + 1);
  const bool is_zero = stem.size() < name.size() && !stem.empty() && std::isdigit(stem.back()) == 0;
  std::filesystem::path next = named;
  if (is_zero)
    next.replace_filename(fmt::format("{}{:0{}}", stem, 1, name.size() - stem.size()));
  else if (!named.has_extension())
    next += "1";
  std::error_code ignored;
  return next != named && std::filesystem::is_regular_file(next, ignored) ? std::optional{next} : std::nullopt;
}

} // namespace

bool gives_sweeps(const std::filesystem::path& capture) {
  return SweepFolder::is(capture) && !KittiDrive::is(capture) && !CaptureFolder::find(capture);
}

std::optional<double> raised_by_deg(const Arguments& arguments) {
  const bool is_odometry = gives_sweeps(arguments.capture) && SweepFolder::is_kitti_odometry(arguments.capture);
  if (!KittiDrive::is(arguments.capture) && !is_odometry)
    return std::nullopt;
  const bool is_published_so =
      arguments.kitti_as_published || (is_odometry && !SweepFolder::is_of_hdl64(arguments.capture));
  return is_published_so ? 0 : kKittiVerticalAngle_deg;
}

RecordedInput open_input(const Arguments& arguments, const CaptureFolder& folder, const Config& config,
                         bool config_is_users_own, std::vector<std::string>& warnings) {
  if (arguments.kitti_as_published && !raised_by_deg(arguments))
    throw Failure(ExitStatus::wrong_usage,
                  fmt::format("--kitti-as-published: {} is not a drive of KITTI; remove this option",
                              folder.lidar.front().string()));
  if (looks_like_bag(folder.lidar.front()))
    return open_bag_input(arguments, folder.lidar.front(), config, config_is_users_own, warnings);
  if (KittiDrive::is(folder.lidar.front()))
    return open_drive_input(arguments, folder.lidar.front(), config, warnings);
  if (gives_sweeps(arguments.capture))
    return open_sweeps_input(arguments, folder, config, config_is_users_own, warnings);
  auto capture = std::make_unique<CaptureSequence>(
      value_or_fail(CaptureSequence::open(folder.lidar, open_capture), ExitStatus::failed));
  const bool has_parts = folder.lidar.size() > 1 && folder.lidar.front() == arguments.capture;
  std::string used = has_parts ? fmt::format("{}: with the parts that follow it, up to {}", arguments.capture.string(),
                                             folder.lidar.back().filename().string())
                               : "";
  if (const auto part = folder.lidar.size() == 1 ? part_beside(arguments.capture) : std::nullopt)
    warnings.push_back(fmt::format("{}: is replayed alone, without {}; if both are parts of one capture, join all of "
                                   "them: mergecap -w WHOLE.pcap PART...",
                                   arguments.capture.string(), part->filename().string()));
  return {
      std::move(capture), read_motion(arguments, folder, config, config_is_users_own, warnings), std::move(used), {}};
}

} // namespace locus::tools

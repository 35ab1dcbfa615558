// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/recorded_input.hpp"

#include <algorithm>
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
#include "locus_replay/failure.hpp"
#include "locus_replay/kitti_packets.hpp"

namespace locus::tools {
namespace {

RecordedInput open_bag_input(const Arguments& arguments, const std::filesystem::path& file, const Config& config,
                             bool config_is_users_own, std::vector<std::string>& warnings) {
  std::unique_ptr<Bag> bag = value_or_fail(open_bag(file), ExitStatus::failed);
  std::vector<MotionRecording> motion = read_motion(arguments, {}, config, false, warnings);
  const auto has_file = [&](SourceId source) {
    return std::ranges::find(motion, source, &MotionRecording::source) != motion.end();
  };
  const BagTopics topics = BagTopics::choose(*bag, file.string(), config, has_file);
  std::ranges::copy(topics.doubts, std::back_inserter(warnings));
  std::ranges::move(read_bag_motion(*bag, file, topics.of_source, warnings), std::back_inserter(motion));
  for (std::size_t i = 0; config_is_users_own && topics.doubts.empty() && i < topics.of_source.size(); ++i) {
    if (!has_file(SourceId{i}))
      warnings.push_back(fmt::format("{}: motion source {}: never heard from, nothing of its kind in the bag",
                                     file.string(), config.motion_sources[i].name));
  }
  return {
      std::make_unique<BagPackets>(std::move(bag), file, config, topics.of_lidar), std::move(motion), topics.taken, {}};
}

RecordedInput open_drive_input(const Arguments& arguments, const std::filesystem::path& folder, const Config& config,
                               std::vector<std::string>& warnings) {
  for (const Fault& fault : arguments.faults) {
    if (std::ranges::any_of(config.lidars, [&](const LidarOptions& lidar) { return fault.strikes_lidar(lidar.name); }))
      throw Failure(
          ExitStatus::wrong_usage,
          fmt::format("--fail {}: a drive of KITTI has no packets that could fail; fail a motion source", fault.name));
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
  const bool takes_oxts = !drive.imu.empty() && imu != sources.end() &&
                          std::ranges::find(input.motion, source, &MotionRecording::source) == input.motion.end();
  if (takes_oxts)
    input.motion.push_back({source, folder / "oxts", MotionSamples<ImuSample>(std::move(drive.imu))});
  const double raised_deg = raised_by_deg(arguments).value_or(0);
  input.taken =
      fmt::format("{}: velodyne_points is lidar {}{}{}; {}", folder.string(), config.lidars.front().name,
                  takes_oxts ? ", oxts is " + imu->name : "", input.truth.empty() ? "" : ", oxts is the truth",
                  raised_deg > 0 ? fmt::format("{} degrees are added to its vertical angles", raised_deg)
                                 : "its vertical angles are as published");
  input.lidars = std::make_unique<KittiPackets>(std::move(drive.sweeps), config.lidars.front(), raised_deg);
  return input;
}

} // namespace

std::optional<double> raised_by_deg(const Arguments& arguments) {
  if (!KittiDrive::is(arguments.capture))
    return std::nullopt;
  return arguments.kitti_as_published ? 0 : kKittiVerticalAngle_deg;
}

RecordedInput open_input(const Arguments& arguments, const CaptureFolder& folder, const Config& config,
                         bool config_is_users_own, std::vector<std::string>& warnings) {
  if (arguments.kitti_as_published && !KittiDrive::is(folder.lidar.front()))
    throw Failure(ExitStatus::wrong_usage, fmt::format("--kitti-as-published: {} is no drive of KITTI; leave it out",
                                                       folder.lidar.front().string()));
  if (looks_like_bag(folder.lidar.front()))
    return open_bag_input(arguments, folder.lidar.front(), config, config_is_users_own, warnings);
  if (KittiDrive::is(folder.lidar.front()))
    return open_drive_input(arguments, folder.lidar.front(), config, warnings);
  auto capture =
      std::make_unique<CaptureSequence>(value_or_fail(CaptureSequence::open(folder.lidar), ExitStatus::failed));
  return {std::move(capture), read_motion(arguments, folder, config, config_is_users_own, warnings), "", {}};
}

} // namespace locus::tools

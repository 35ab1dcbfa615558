// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/recorded_input.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

#include <fmt/format.h>

#include "bags/bag.hpp"
#include "drivers/capture.hpp"
#include "locus_replay/bag_motion.hpp"
#include "locus_replay/bag_packets.hpp"
#include "locus_replay/bag_topics.hpp"
#include "locus_replay/failure.hpp"

namespace locus::tools {
namespace {

RecordedInput open_bag_input(const Arguments& arguments, const std::filesystem::path& file, const Config& config,
                             bool config_is_users_own, std::vector<std::string>& warnings) {
  std::unique_ptr<Bag> bag = value_or_fail(open_bag(file), ExitStatus::failed);
  std::vector<MotionRecording> motion = read_motion(arguments, {}, config, false, warnings);
  const auto has_file = [&](std::size_t source) {
    return std::ranges::find(motion, source, &MotionRecording::source) != motion.end();
  };
  const BagTopics topics = BagTopics::choose(*bag, file.string(), config, has_file);
  std::ranges::copy(topics.doubts, std::back_inserter(warnings));
  std::ranges::move(read_bag_motion(*bag, file, topics.of_source, warnings), std::back_inserter(motion));
  for (std::size_t source = 0; config_is_users_own && topics.doubts.empty() && source < topics.of_source.size();
       ++source) {
    if (!has_file(source))
      warnings.push_back(fmt::format("{}: motion source {}: never heard from, nothing of its kind in the bag",
                                     file.string(), config.odometry.motion_sources[source].name));
  }
  return {std::make_unique<BagPackets>(std::move(bag), file, config, topics.of_lidar), std::move(motion), topics.taken};
}

} // namespace

RecordedInput open_input(const Arguments& arguments, const CaptureFolder& folder, const Config& config,
                         bool config_is_users_own, std::vector<std::string>& warnings) {
  if (looks_like_bag(folder.lidar))
    return open_bag_input(arguments, folder.lidar, config, config_is_users_own, warnings);
  auto capture = std::make_unique<Capture>(value_or_fail(Capture::open(folder.lidar), ExitStatus::failed));
  return {std::move(capture), read_motion(arguments, folder, config, config_is_users_own, warnings), ""};
}

} // namespace locus::tools

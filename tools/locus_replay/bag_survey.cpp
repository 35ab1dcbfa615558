// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/bag_survey.hpp"

#include <algorithm>
#include <optional>
#include <string_view>
#include <vector>

#include "bags/messages.hpp"
#include "drivers/clouds/cloud_layout.hpp"
#include "drivers/clouds/cloud_view.hpp"
#include "locus_replay/failure.hpp"

namespace locus::tools {
namespace {

bool is_static_transform(const BagTopic& topic) { return topic.type == kTransformsType && topic.name == kStaticTopic; }

bool is_motion_type(std::string_view type) { return type == kImuType || type == kOdometryType; }

/// Returns whether the topic is a sensor's, whose messages begin with a header.
bool names_a_frame(const BagTopic& topic) {
  return is_cloud_type(topic.type) || is_motion_type(topic.type) ||
         (packet_type(topic.type) != nullptr && !is_ouster_type(topic.type));
}

void add_motion(const BagTopic& topic, const BagMessage& message, const MessageReader& reader,
                std::optional<MotionCandidate>& motion) {
  if (!motion) {
    const bool is_imu = topic.type == kImuType;
    const std::string_view frame = is_imu ? frame_of(reader) : child_frame_of(reader);
    motion = MotionCandidate{.topic = topic.name.starts_with('/') ? topic.name : '/' + topic.name,
                             .kind = is_imu ? SourceKind::imu : SourceKind::odometry,
                             .frame = std::string{frame.substr(0, kMaxNameBytes)}};
  }
  if (motion->kind == SourceKind::imu) {
    if (const auto imu = read_imu(reader))
      motion->add(*imu, message.recorded);
  } else if (const auto odometry = read_odometry(reader)) {
    motion->add(*odometry, message.recorded);
  }
}

void add(const BagTopic& topic, const BagMessage& message, BagSurvey::Topic& surveyed) {
  const MessageReader reader(message.data, topic.serialisation);
  if (is_motion_type(topic.type))
    add_motion(topic, message, reader, surveyed.motion);
  if (const std::string_view frame = frame_of(reader); surveyed.messages++ == 0 && frame.size() <= kMaxNameBytes)
    surveyed.frame = frame;
  if (!is_cloud_type(topic.type))
    return;
  if (const auto cloud = read_cloud(reader, topic.type))
    surveyed.points += points_of(*cloud);
}

/// Returns whether enough messages of a topic are known. `has_rivals`: it is one of several odometries.
bool is_enough(const BagTopic& topic, const BagSurvey::Topic& surveyed, bool has_rivals) {
  constexpr std::size_t kEnoughClouds = 3, kEnoughForces = 100;
  if (topic.type == kOdometryType && has_rivals)
    return surveyed.motion && surveyed.motion->moves();
  return surveyed.messages >= (is_cloud_type(topic.type) ? kEnoughClouds : topic.type == kImuType ? kEnoughForces : 1);
}

} // namespace

BagSurvey BagSurvey::of(const std::filesystem::path& file) {
  constexpr Duration kLong = std::chrono::seconds{10};
  BagSurvey survey{value_or_fail(open_bag(file), ExitStatus::failed), {}, {}};
  const std::vector<BagTopic>& topics = survey.bag->topics();
  for (std::size_t i = 0; i < topics.size(); ++i) {
    if (names_a_frame(topics[i]))
      survey.topics[i];
  }
  bool waits_for_transforms = std::ranges::any_of(topics, is_static_transform);
  const bool has_rivals = std::ranges::count(topics, kOdometryType, &BagTopic::type) > 1;
  const auto lacks = [&](std::string_view type) {
    return std::ranges::any_of(survey.topics, [&](const auto& entry) {
      const BagTopic& topic = topics[entry.first];
      return (type.empty() || topic.type == type) && !is_enough(topic, entry.second, has_rivals);
    });
  };
  std::optional<Stamp> first;
  while (waits_for_transforms || lacks("")) {
    const BagMessage* const message = survey.bag->next();
    if (message == nullptr)
      break;
    first = first.value_or(message->recorded);
    if (message->recorded - *first > kLong && !(has_rivals && lacks(kOdometryType)))
      break;
    const BagTopic& topic = topics[message->topic];
    if (is_static_transform(topic)) {
      survey.transforms.add({message->data, topic.serialisation});
      waits_for_transforms = false;
    }
    if (names_a_frame(topic))
      add(topic, *message, survey.topics[message->topic]);
  }
  return survey;
}

} // namespace locus::tools

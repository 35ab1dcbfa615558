// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/bag_survey.hpp"

#include <algorithm>
#include <optional>
#include <vector>

#include "bags/messages.hpp"
#include "drivers/clouds/cloud_layout.hpp"
#include "drivers/clouds/cloud_view.hpp"
#include "locus_replay/failure.hpp"

namespace locus::tools {
namespace {

bool is_static_transform(const BagTopic& topic) { return topic.type == kTransformsType && topic.name == kStaticTopic; }

/// Returns whether the topic is a sensor's, whose messages begin with a header.
bool names_a_frame(const BagTopic& topic) {
  return is_cloud_type(topic.type) || topic.type == kImuType ||
         (packet_type(topic.type) != nullptr && !is_ouster_type(topic.type));
}

void add(const BagTopic& topic, const BagMessage& message, BagSurvey::Topic& surveyed) {
  const MessageReader reader(message.data, topic.serialisation);
  if (const std::string_view frame = frame_of(reader); surveyed.messages++ == 0 && frame.size() <= kMaxNameBytes)
    surveyed.frame = frame;
  if (!is_cloud_type(topic.type))
    return;
  if (const auto cloud = read_cloud(reader, topic.type))
    surveyed.points += points_of(*cloud);
}

} // namespace

BagSurvey BagSurvey::of(const std::filesystem::path& file) {
  constexpr Duration kLong = std::chrono::seconds{10};
  constexpr std::size_t kEnoughClouds = 3;
  BagSurvey survey{value_or_fail(open_bag(file), ExitStatus::failed), {}, {}};
  const std::vector<BagTopic>& topics = survey.bag->topics();
  for (std::size_t i = 0; i < topics.size(); ++i) {
    if (names_a_frame(topics[i]))
      survey.topics[i];
  }
  bool waits_for_transforms = std::ranges::any_of(topics, is_static_transform);
  const auto is_enough = [&](const auto& entry) {
    return entry.second.messages >= (is_cloud_type(topics[entry.first].type) ? kEnoughClouds : 1);
  };
  std::optional<Stamp> first;
  while (waits_for_transforms || !std::ranges::all_of(survey.topics, is_enough)) {
    const BagMessage* const message = survey.bag->next();
    if (message == nullptr || message->recorded - first.value_or(message->recorded) > kLong)
      break;
    first = first.value_or(message->recorded);
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

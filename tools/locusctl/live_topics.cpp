// SPDX-License-Identifier: Apache-2.0
#include "locusctl/live_topics.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

#include "daemon/dds/cdr.hpp"
#include "drivers/clouds/message_reader.hpp"

namespace locus::tools {

namespace ros = daemon::ros;

namespace {

template <class Message> bool is_of(std::string_view type) {
  return type == ros::type_of<Message>().descriptor->m_typename;
}

std::string text_or_empty(const char* text) { return text == nullptr ? "" : text; }

} // namespace

Expected<LiveTopics, std::string> LiveTopics::join(const DdsOptions& options) {
  Expected<daemon::DdsNode, std::string> node = daemon::DdsNode::open(options);
  if (!node)
    return node.error();
  return LiveTopics(std::move(*node), options);
}

LiveTopics::LiveTopics(daemon::DdsNode node, const DdsOptions& options)
    : node_(std::move(node)), results_(options.prefix + '/'), publications_(node_),
      static_tf_(node_, std::string{kStaticTopic}, {true, 100, true}) {}

void LiveTopics::poll(Stamp now) {
  publications_.take([this](const std::string& topic, std::string_view type) {
    if (!topic.starts_with(results_))
      subscribe_to(topic, type);
  });
  receive_transforms();
  for (auto& [topic, source] : motion_) {
    MotionCandidate& candidate = source.candidate;
    if (source.imu)
      source.imu->take([&](const ros::Imu& message) {
        candidate.frame = text_or_empty(message.header_.frame_id_);
        candidate.add(message, now);
      });
    if (source.odometry)
      source.odometry->take([&](const ros::Odometry& message) {
        candidate.frame = text_or_empty(message.child_frame_id_);
        candidate.add(message, now);
      });
  }
  for (auto& [topic, clouds] : clouds_)
    receive_clouds(clouds);
}

void LiveTopics::receive_clouds(Clouds& clouds) {
  clouds.reader.follow(node_);
  clouds.reader.take_serialised([&](const daemon::SerialisedSample& sample, dds_instance_handle_t /*writer*/) {
    message_.resize(sample.size());
    sample.copy_to(message_);
    if (const auto cloud = read_cloud({message_, Serialisation::cdr}, clouds.reader.type())) {
      clouds.candidate.frame = cloud->frame;
      clouds.candidate.points += std::size_t{cloud->height} * cloud->width;
      ++clouds.candidate.messages;
    }
  });
}

void LiveTopics::subscribe_to(const std::string& topic, std::string_view type) {
  using daemon::TopicQos;
  if (motion_.size() + clouds_.size() >= kMostTopics || motion_.contains(topic) || clouds_.contains(topic))
    return;
  if (is_of<ros::Imu>(type))
    motion_[topic] = {{.topic = topic, .kind = SourceKind::imu, .frame = ""},
                      daemon::DdsReader<ros::Imu>(node_, topic, TopicQos::sensor_in())};
  else if (is_of<ros::Odometry>(type))
    motion_[topic] = {{.topic = topic, .kind = SourceKind::odometry, .frame = ""},
                      {},
                      daemon::DdsReader<ros::Odometry>(node_, topic, TopicQos::sensor_in())};
  else if (daemon::CloudReader::carries_clouds(type))
    clouds_.emplace(topic, Clouds{{.topic = topic, .frame = ""}, {node_, topic, TopicQos::cloud_in()}})
        .first->second.reader.discover(topic, type);
}

void LiveTopics::receive_transforms() {
  static_tf_.take([&](const ros::TFMessage& message) {
    std::vector<std::byte> bytes;
    ros::serialise(message, bytes);
    transforms_.add({bytes, Serialisation::cdr});
  });
}

std::vector<MotionCandidate> LiveTopics::motion() const {
  std::vector<MotionCandidate> candidates;
  for (const auto& [topic, source] : motion_)
    if (source.candidate.messages > 0)
      candidates.push_back(source.candidate);
  return candidates;
}

std::vector<CloudCandidate> LiveTopics::clouds() const {
  std::vector<CloudCandidate> candidates;
  for (const auto& [topic, clouds] : clouds_)
    if (clouds.candidate.messages > 0)
      candidates.push_back(clouds.candidate);
  std::ranges::stable_sort(candidates, std::greater{}, &CloudCandidate::points);
  return candidates;
}

} // namespace locus::tools

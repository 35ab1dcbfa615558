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

template <class Message> bool is_of(const std::string& type) {
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
    : node_(std::move(node)), results_(options.prefix + '/'),
      publications_(dds_create_reader(node_.participant(), DDS_BUILTIN_TOPIC_DCPSPUBLICATION, nullptr, nullptr)),
      static_tf_(node_, std::string{kStaticTopic}, {true, 100, true}) {}

void LiveTopics::poll(Stamp now) {
  subscribe();
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
    clouds.reader.take([&candidate = clouds.candidate](const ros::PointCloud2& message) {
      candidate.frame = text_or_empty(message.header_.frame_id_);
      candidate.points += std::size_t{message.height_} * message.width_;
      ++candidate.messages;
    });
}

void LiveTopics::subscribe() {
  constexpr std::uint32_t kMostEndpoints = 256;
  std::array<void*, kMostEndpoints> samples{};
  std::array<dds_sample_info_t, kMostEndpoints> infos{};
  const dds_return_t count =
      dds_take(publications_.handle(), samples.data(), infos.data(), kMostEndpoints, kMostEndpoints);
  for (std::size_t i = 0; count > 0 && i < static_cast<std::size_t>(count); ++i) {
    const auto* const writer = static_cast<const dds_builtintopic_endpoint_t*>(samples[i]);
    const std::string name = infos[i].valid_data ? writer->topic_name : "";
    constexpr std::string_view kOfRos = "rt/";
    if (name.starts_with(kOfRos) && !name.starts_with("rt" + results_))
      subscribe_to(name.substr(kOfRos.size() - 1), writer->type_name);
  }
  if (count > 0)
    dds_return_loan(publications_.handle(), samples.data(), count);
}

void LiveTopics::subscribe_to(const std::string& topic, const std::string& type) {
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
  else if (is_of<ros::PointCloud2>(type))
    clouds_.emplace(topic, Clouds{{.topic = topic, .frame = ""},
                                  daemon::DdsReader<ros::PointCloud2>(node_, topic, TopicQos::cloud_in())});
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

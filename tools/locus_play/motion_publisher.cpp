// SPDX-License-Identifier: Apache-2.0
#include "locus_play/motion_publisher.hpp"

#include <ctime>

#include "daemon/dds/ros_messages.hpp"
#include "daemon/machine_time.hpp"
#include "locus_replay/failure.hpp"
#include "locus_replay/motion_messages.hpp"

namespace locus::tools {

using daemon::DdsWriter;
using daemon::TopicQos;
namespace ros = daemon::ros;

MotionPublisher::MotionPublisher(const Config& config, bool clock)
    : node_(value_or_fail(daemon::DdsNode::open(config.dds), ExitStatus::failed)), frame_odom_(config.dds.frame_odom),
      frame_base_(config.dds.frame_base) {
  for (const MotionSource& source : config.motion_sources) {
    const SourceId id{topics_.size()};
    topics_.push_back(source.topic);
    if (source.topic.empty())
      continue;
    if (source.kind == SourceKind::imu)
      imus_.emplace(id, DdsWriter<ros::Imu>(node_, source.topic, TopicQos::sensor_out()));
    else
      odometries_.emplace(id, DdsWriter<ros::Odometry>(node_, source.topic, TopicQos::standard()));
  }
  if (clock)
    clock_.emplace(node_, "/clock", TopicQos::clock());
}

void MotionPublisher::publish(daemon::ImuInput input, Duration shift) {
  const auto writer = imus_.find(input.source);
  if (writer == imus_.end())
    return;
  input.sample.stamp += shift;
  refused_ += writer->second.write(to_ros(input.sample, frame_base_)) ? 0U : 1U;
}

void MotionPublisher::publish(daemon::OdometryInput input, Duration shift) {
  const auto writer = odometries_.find(input.source);
  if (writer == odometries_.end())
    return;
  input.sample.stamp += shift;
  const daemon::FrameNames frames{frame_odom_, frame_base_};
  refused_ += writer->second.write(to_ros(input.sample, frames)) ? 0U : 1U;
}

void MotionPublisher::publish_clock(Stamp now) {
  const Duration monotonic = daemon::read_clock(CLOCK_MONOTONIC);
  if (!clock_ || monotonic < clock_due_ || now <= published_time_)
    return;
  refused_ += clock_->write({daemon::to_ros(now)}) ? 0U : 1U;
  published_time_ = now;
  clock_due_ = monotonic + kClockPeriod;
}

std::vector<std::string> MotionPublisher::topics_without_subscribers() const {
  std::vector<std::string> topics;
  if (clock_ && !clock_->has_readers())
    topics.emplace_back("/clock");
  for (const auto& [source, writer] : imus_)
    if (!writer.has_readers())
      topics.push_back(topics_[index_of(source)]);
  for (const auto& [source, writer] : odometries_)
    if (!writer.has_readers())
      topics.push_back(topics_[index_of(source)]);
  return topics;
}

} // namespace locus::tools

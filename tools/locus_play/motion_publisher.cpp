// SPDX-License-Identifier: Apache-2.0
#include "locus_play/motion_publisher.hpp"

#include <ctime>

#include "daemon/dds/ros_messages.hpp"
#include "daemon/machine_time.hpp"
#include "locus_replay/failure.hpp"

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

void MotionPublisher::publish(const daemon::ImuInput& input, Duration shift) {
  const auto writer = imus_.find(input.source);
  if (writer == imus_.end())
    return;
  const Eigen::Vector3d& w = input.sample.angular_velocity_radps;
  const Eigen::Vector3d& f = input.sample.specific_force_mps2;
  ros::Imu message{};
  message.header_ = {daemon::to_ros(input.sample.stamp + shift), frame_base_.data()};
  if (const auto& q = input.sample.attitude)
    message.orientation_ = {q->x(), q->y(), q->z(), q->w()};
  else
    message.orientation_covariance_[0] = -1; // REP 145: not available
  message.angular_velocity_ = {w.x(), w.y(), w.z()};
  message.linear_acceleration_ = {f.x(), f.y(), f.z()};
  refused_ += writer->second.write(message) ? 0U : 1U;
}

void MotionPublisher::publish(const daemon::OdometryInput& input, Duration shift) {
  constexpr double kUsualVariance = 1e-4;
  const auto writer = odometries_.find(input.source);
  if (writer == odometries_.end())
    return;
  daemon::OdometryReport report{.stamp = input.sample.stamp + shift, .T_odom_base = input.sample.T_source_base};
  report.twist_covariance.diagonal().setConstant(kUsualVariance * input.sample.covariance_scale);
  const daemon::FrameNames frames{frame_odom_, frame_base_};
  refused_ += writer->second.write(daemon::to_ros(report, frames)) ? 0U : 1U;
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

// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/bag_motion.hpp"

#include <algorithm>
#include <cstdint>
#include <utility>

#include <fmt/format.h>

#include "bags/messages.hpp"
#include "daemon/dds/ros_messages.hpp"

namespace locus::tools {
namespace {

Stamp arrival_of(Stamp stamp, Stamp recorded) {
  constexpr Duration kLongestDelay = std::chrono::seconds{10};
  return std::chrono::abs(recorded - stamp) > kLongestDelay ? stamp : recorded;
}

/// Collects the samples of one topic.
class MotionTopic {
 public:
  MotionTopic(SourceId source, std::size_t topic, BagTopic name, bool beside_packets)
      : source_(source), topic_(topic), name_(std::move(name)), beside_packets_(beside_packets) {}

  [[nodiscard]] std::size_t topic() const { return topic_; }

  void add(const BagMessage& message, MessageReader reader) {
    if (name_.type == kImuType)
      keep(
          read_imu(reader), imu_, [&](const auto& imu) { return daemon::to_sample(imu, message.recorded); }, message);
    else
      keep(
          read_odometry(reader), odometry_,
          [&](const auto& odometry) { return daemon::to_sample(odometry, message.recorded, usual_); }, message);
  }

  [[nodiscard]] MotionRecording recording(const std::filesystem::path& file) && {
    const std::filesystem::path place = fmt::format("{}: {}", file.string(), name_.name);
    if (name_.type == kImuType)
      return {source_, place, in_order(std::move(imu_))};
    return {source_, place, in_order(std::move(odometry_))};
  }

  /// Returns a line about unreadable messages; empty if there are none.
  [[nodiscard]] std::string problem(const std::filesystem::path& file) const {
    return malformed_ == 0
               ? ""
               : fmt::format("{}: {} messages on {} are truncated or not a {} and were skipped; record again "
                             "if it matters",
                             file.string(), malformed_, name_.name, name_.type);
  }

 private:
  template <class Message, class Sample, class Convert>
  void keep(const std::optional<Message>& read, std::vector<Sample>& samples, const Convert& convert,
            const BagMessage& message) {
    if (!read) {
      ++malformed_;
      return;
    }
    Sample sample = convert(*read);
    sample.stamp = stamp_or(message.recorded, sample.stamp);
    sample.arrival = beside_packets_ ? arrival_of(sample.stamp, message.recorded) : message.recorded;
    samples.push_back(std::move(sample));
  }

  template <class Sample> static MotionSamples<Sample> in_order(std::vector<Sample> samples) {
    std::ranges::stable_sort(samples, {}, &Sample::arrival);
    return MotionSamples<Sample>(std::move(samples));
  }

  SourceId source_;
  std::size_t topic_;
  BagTopic name_;
  bool beside_packets_;
  std::vector<ImuSample> imu_;
  std::vector<OdometrySample> odometry_;
  daemon::UsualCovariance usual_;
  std::uint64_t malformed_ = 0;
};

} // namespace

std::vector<MotionRecording> read_bag_motion(Bag& bag, const std::filesystem::path& file,
                                             const std::vector<std::optional<std::size_t>>& topic_of_source,
                                             bool beside_packets, std::vector<std::string>& warnings) {
  std::vector<MotionTopic> motion;
  for (std::size_t i = 0; i < topic_of_source.size(); ++i) {
    if (const auto topic = topic_of_source[i])
      motion.emplace_back(SourceId{i}, *topic, bag.topics()[*topic], beside_packets);
  }
  while (const BagMessage* message = motion.empty() ? nullptr : bag.next()) {
    const auto found = std::ranges::find(motion, message->topic, &MotionTopic::topic);
    if (found != motion.end())
      found->add(*message, {message->data, bag.topics()[message->topic].serialisation});
  }
  bag.rewind();
  std::vector<MotionRecording> recordings;
  for (MotionTopic& topic : motion) {
    if (std::string problem = topic.problem(file); !problem.empty())
      warnings.push_back(std::move(problem));
    recordings.push_back(std::move(topic).recording(file));
  }
  return recordings;
}

} // namespace locus::tools

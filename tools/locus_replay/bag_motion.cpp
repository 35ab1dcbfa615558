// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/bag_motion.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <iterator>
#include <utility>

#include <fmt/format.h>

#include "bags/messages.hpp"
#include "daemon/dds/ros_messages.hpp"

namespace locus::tools {
namespace {

/// Replaces stamps by arrivals where they cannot be those of a clock: all the same, or of another lag than most by more
/// than any transit; all of them if most differ. Returns how many, except those after whose stamp the clock was set.
template <class Sample> std::uint64_t replace_wrong_stamps(std::vector<Sample>& samples) {
  constexpr Duration kLongestTransit = std::chrono::seconds{10};
  if (samples.size() < 2)
    return 0;
  std::vector<Duration> lags;
  for (const Sample& sample : samples)
    lags.push_back(sample.arrival - sample.stamp);
  const auto middle = lags.begin() + static_cast<std::ptrdiff_t>(lags.size() / 2);
  std::ranges::nth_element(lags, middle);
  const Duration usual = *middle;
  const auto is_wrong = [&](const Sample& sample) {
    return std::chrono::abs(sample.arrival - sample.stamp - usual) > kLongestTransit;
  };
  const bool are_constant =
      std::ranges::adjacent_find(samples, std::ranges::not_equal_to{}, &Sample::stamp) == samples.end();
  const bool are_all_wrong = are_constant || 2 * std::ranges::count_if(samples, is_wrong) > std::ssize(samples);
  std::uint64_t replaced = 0;
  Stamp previous = samples.front().arrival;
  for (Sample& sample : samples) {
    const bool clock_was_set =
        std::chrono::abs(sample.arrival - std::exchange(previous, sample.arrival)) > kLongestTransit;
    if (!are_all_wrong && !is_wrong(sample))
      continue;
    sample.stamp = sample.arrival - (are_all_wrong ? Duration{} : usual);
    replaced += clock_was_set ? 0U : 1U;
  }
  return replaced;
}

/// Collects the samples of one topic.
class MotionTopic {
 public:
  MotionTopic(SourceId source, std::size_t topic, BagTopic name, Duration recorder_ahead)
      : source_(source), topic_(topic), name_(std::move(name)), recorder_ahead_(recorder_ahead) {}

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

  /// Replaces wrong stamps. Call after the last message.
  void finish() { replaced_ = name_.type == kImuType ? replace_wrong_stamps(imu_) : replace_wrong_stamps(odometry_); }

  [[nodiscard]] MotionRecording recording(const std::filesystem::path& file) && {
    const std::filesystem::path place = fmt::format("{}: {}", file.string(), name_.name);
    if (name_.type == kImuType)
      return {source_, place, in_order(std::move(imu_))};
    return {source_, place, in_order(std::move(odometry_))};
  }

  /// Adds lines about unreadable messages and wrong stamps.
  void add_problems(const std::filesystem::path& file, std::vector<std::string>& lines) const {
    if (malformed_ > 0)
      lines.push_back(fmt::format("{}: {} messages on {} are truncated or not a {} and were skipped; record again if "
                                  "it matters",
                                  file.string(), malformed_, name_.name, name_.type));
    if (replaced_ > 0)
      lines.push_back(fmt::format("{}: {}: the stamps of {} messages are constant, zero or absurd: the times at which "
                                  "the bag was recorded are used instead",
                                  file.string(), name_.name, replaced_));
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
    sample.arrival = message.recorded - recorder_ahead_;
    sample.stamp = stamp_or(sample.arrival, sample.stamp);
    samples.push_back(std::move(sample));
  }

  template <class Sample> static MotionSamples<Sample> in_order(std::vector<Sample> samples) {
    MotionSamples<Sample> as_recorded(std::move(samples));
    if (as_recorded.steps_back() > 0)
      return as_recorded;
    samples = as_recorded.drain();
    std::ranges::stable_sort(samples, {}, &Sample::arrival);
    return MotionSamples<Sample>(std::move(samples));
  }

  SourceId source_;
  std::size_t topic_;
  BagTopic name_;
  Duration recorder_ahead_;
  std::vector<ImuSample> imu_;
  std::vector<OdometrySample> odometry_;
  daemon::UsualCovariance usual_;
  std::uint64_t malformed_ = 0, replaced_ = 0;
};

} // namespace

std::vector<MotionRecording> read_bag_motion(Bag& bag, const std::filesystem::path& file,
                                             const std::vector<std::optional<std::size_t>>& topic_of_source,
                                             Duration recorder_ahead, std::vector<std::string>& warnings) {
  std::vector<MotionTopic> motion;
  for (std::size_t i = 0; i < topic_of_source.size(); ++i) {
    if (const auto topic = topic_of_source[i])
      motion.emplace_back(SourceId{i}, *topic, bag.topics()[*topic], recorder_ahead);
  }
  while (const BagMessage* message = motion.empty() ? nullptr : bag.next()) {
    const auto found = std::ranges::find(motion, message->topic, &MotionTopic::topic);
    if (found != motion.end())
      found->add(*message, {message->data, bag.topics()[message->topic].serialisation});
  }
  bag.rewind();
  std::vector<MotionRecording> recordings;
  for (MotionTopic& topic : motion) {
    topic.finish();
    topic.add_problems(file, warnings);
    recordings.push_back(std::move(topic).recording(file));
  }
  return recordings;
}

} // namespace locus::tools

// SPDX-License-Identifier: Apache-2.0
#include "looped_course.hpp"

#include <algorithm>
#include <thread>
#include <utility>

#include "drivers/files/capture_folder.hpp"
#include "drivers/files/capture_sequence.hpp"
#include "drivers/packet_edit.hpp"
#include "locus_replay/failure.hpp"
#include "locus_replay/motion_recordings.hpp"
#include "locus_replay/recording.hpp"

namespace locus::soak {

namespace {

using tools::ExitStatus;
using tools::value_or_fail;

CaptureFolder find_files(const ClosedCourse& course) {
  return value_or_fail(CaptureFolder::find(course.folder), ExitStatus::failed);
}

std::vector<tools::MotionRecording> read_motion(const ClosedCourse& course, const Config& config) {
  std::vector<std::string> warnings;
  return tools::read_motion({}, find_files(course), config, true, warnings);
}

} // namespace

LoopedCourse::LoopedCourse(ClosedCourse course, const Config& config, std::uint64_t lap)
    : course_(std::move(course)), config_(config), offset_(static_cast<Duration::rep>(lap) * course_.lap),
      T_begin_end_(config.motion_sources.size()), T_source_lap_(T_begin_end_.size()) {
  learn_wheels();
  for (std::uint64_t before = 0; before < lap; ++before)
    for (std::size_t source = 0; source < T_begin_end_.size(); ++source)
      T_source_lap_[source] = T_source_lap_[source] * T_begin_end_[source];
  now_ = start_ + offset_;
}

LoopedCourse::~LoopedCourse() = default;

/// Reads the start of the course and the odometry's motion over a lap, which is closed in truth.
void LoopedCourse::learn_wheels() {
  for (tools::MotionRecording& motion : read_motion(course_, config_)) {
    auto* samples = std::get_if<MotionSamples<OdometrySample>>(&motion.samples);
    if (samples == nullptr || samples->front() == nullptr)
      continue;
    start_ = samples->front()->stamp;
    for (; samples->front() != nullptr && samples->front()->stamp < start_ + course_.lap; samples->pop())
      T_begin_end_[index_of(motion.source)] = samples->front()->T_source_base;
  }
}

void LoopedCourse::begin_lap(const std::vector<Fault>& faults, Duration until_pause) {
  auto capture = value_or_fail(CaptureSequence::open(find_files(course_).lidar), ExitStatus::failed);
  recording_ = std::make_unique<tools::Recording>(
      std::make_unique<CaptureSequence>(std::move(capture)), read_motion(course_, config_), config_,
      value_or_fail(LidarRouter::open(config_.lidars), ExitStatus::failed),
      tools::PlayOptions{{}, {}, faults, static_cast<std::uint64_t>(offset_ / course_.lap)});
  pause_at_ = until_pause < course_.lap ? start_ + offset_ + until_pause : Stamp::max();
  go_on();
}

void LoopedCourse::miss(Duration duration) {
  now_ += duration;
  heard_from_ = now_;
}

daemon::Input LoopedCourse::next(Duration timeout) {
  if (is_at_rest()) {
    std::this_thread::sleep_for(std::min<Duration>(timeout, std::chrono::milliseconds{1}));
    return daemon::Silence{now_};
  }
  daemon::Input input = carry_forward(recording_->next(timeout));
  if (std::holds_alternative<daemon::EndOfInput>(input)) {
    end_lap();
    return daemon::Silence{now_};
  }
  const Stamp arrival = daemon::arrival_of(input, now_);
  if (is_of_next_lap(input) || arrival < heard_from_)
    return daemon::Silence{now_};
  now_ = std::max(now_, arrival);
  count(input);
  if (arrival >= pause_at_) {
    pause_at_ = Stamp::max();
    at_rest_.store(true, std::memory_order_release);
  }
  return input;
}

void LoopedCourse::end_lap() {
  recording_.reset();
  offset_ += course_.lap;
  for (std::size_t source = 0; source < T_begin_end_.size(); ++source)
    T_source_lap_[source] = T_source_lap_[source] * T_begin_end_[source];
  at_rest_.store(true, std::memory_order_release);
}

/// Datagrams belong to the lap until its last packet has arrived; motion is received sooner.
bool LoopedCourse::is_of_next_lap(const daemon::Input& input) const {
  return !std::holds_alternative<Datagram>(input) &&
         daemon::arrival_of(input, start_) >= start_ + offset_ + course_.lap;
}

daemon::Input LoopedCourse::carry_forward(const daemon::Input& input) {
  daemon::Input carried = input;
  if (auto* datagram = std::get_if<Datagram>(&carried)) {
    payload_.assign(datagram->payload.begin(), datagram->payload.end());
    shift_clock(payload_, nullptr, offset_);
    datagram->payload = payload_;
    datagram->receive_stamp += offset_;
  } else if (auto* imu = std::get_if<daemon::ImuInput>(&carried)) {
    imu->sample.stamp += offset_;
    imu->sample.arrival += offset_;
  } else if (auto* odometry = std::get_if<daemon::OdometryInput>(&carried)) {
    odometry->sample.stamp += offset_;
    odometry->sample.arrival += offset_;
    odometry->sample.T_source_base = T_source_lap_[index_of(odometry->source)] * odometry->sample.T_source_base;
  } else if (auto* silence = std::get_if<daemon::Silence>(&carried)) {
    silence->now += offset_;
  }
  return carried;
}

void LoopedCourse::count(const daemon::Input& input) {
  if (std::holds_alternative<Datagram>(input))
    ++given_.datagrams;
  else if (const auto* imu = std::get_if<daemon::ImuInput>(&input))
    ++given_.samples[index_of(imu->source)];
  else if (const auto* odometry = std::get_if<daemon::OdometryInput>(&input))
    ++given_.samples[index_of(odometry->source)];
}

} // namespace locus::soak

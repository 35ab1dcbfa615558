// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/recorded_times.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

#include <fmt/format.h>

namespace locus::tools {
namespace {

constexpr Duration kLongestStep = std::chrono::seconds{1}; ///< from one packet to the next of a lidar that goes on
constexpr Duration kLookAhead = std::chrono::milliseconds{500};

bool has_bytes(const Datagram& datagram) { return datagram.decoded == nullptr && datagram.cloud == nullptr; }

} // namespace

RecordedTimes::RecordedTimes(std::unique_ptr<DatagramSource> source, std::vector<LidarOptions> lidars)
    : source_(std::move(source)), lidars_(std::move(lidars)) {
  for (LidarOptions& lidar : lidars_)
    lidar.time = locus::LidarTime::sensor;
}

const Datagram* RecordedTimes::next() {
  if (!std::exchange(has_looked_ahead_, true))
    look_ahead();
  const Datagram* const datagram = take_next();
  if (datagram == nullptr)
    return nullptr;
  datagram_ = *datagram;
  if (lidar_time_)
    follow_lidar();
  return &datagram_;
}

const Datagram* RecordedTimes::take_next() {
  if (held_.empty())
    return source_->next();
  given_out_ = std::move(held_.front());
  held_.pop_front();
  given_out_.datagram.payload = given_out_.payload;
  return &given_out_.datagram;
}

std::optional<RecordedTimes::LidarTime> RecordedTimes::open_time() const {
  auto lidars = LidarRouter::open(lidars_);
  return lidars ? std::optional(LidarTime{std::move(*lidars)}) : std::nullopt;
}

/// Reads the first packets, and decides whose clock tells their arrivals.
void RecordedTimes::look_ahead() {
  constexpr std::size_t kMostHeld = 4'000;
  std::optional<LidarTime> time = open_time();
  while (time && held_.size() < kMostHeld && time->elapsed() < kLookAhead) {
    const Datagram* const datagram = source_->next();
    if (datagram == nullptr)
      break;
    held_.push_back({*datagram, {datagram->payload.begin(), datagram->payload.end()}});
    if (!has_bytes(*datagram)) // lives until the next call only
      return;
    time->take(*datagram);
  }
  if (!time || !arrivals_stand_still(*time))
    return;
  is_utc_ = time->utc().has_value();
  begin_ = time->utc().value_or(held_.front().datagram.receive_stamp);
  lidar_time_ = open_time();
}

bool RecordedTimes::arrivals_stand_still(const LidarTime& time) const {
  constexpr Duration kLeastToJudge = std::chrono::milliseconds{100};
  constexpr int kTooSlow = 100;
  if (time.elapsed() < kLeastToJudge)
    return false;
  const auto [earliest, latest] =
      std::ranges::minmax(held_, {}, [](const Held& held) { return held.datagram.receive_stamp; });
  return kTooSlow * (latest.datagram.receive_stamp - earliest.datagram.receive_stamp) < time.elapsed();
}

bool RecordedTimes::LidarTime::take(Datagram datagram) {
  datagram.receive_stamp = latest_;
  const LidarPacket* const packet = lidars_.receive(datagram);
  if (packet == nullptr || packet->lidar != lidar_.value_or(packet->lidar))
    return false;
  const bool is_first = !std::exchange(lidar_, packet->lidar).has_value();
  const Duration step = is_first ? Duration{} : packet->stamp - latest_;
  const bool is_overtaken = step < Duration{} && step >= -kLongestStep;
  const bool goes_on = step >= Duration{} && step <= kLongestStep;
  if (is_first)
    first_ = packet->stamp;
  if (!is_overtaken)
    latest_ = packet->stamp;
  elapsed_ += goes_on ? step : Duration{};
  return goes_on;
}

std::optional<Stamp> RecordedTimes::LidarTime::utc() const {
  const auto& position = lidar_ ? lidars_.lidars()[*lidar_].position() : std::nullopt;
  if (!position || !position->is_synchronised() || !position->rmc->date)
    return std::nullopt;
  const Stamp told = Stamp{std::chrono::sys_days{*position->rmc->date}.time_since_epoch()} + position->rmc->time_of_day;
  return first_ + std::chrono::round<std::chrono::hours>(told - latest_);
}

void RecordedTimes::follow_lidar() {
  lidar_time_->take(datagram_);
  datagram_.receive_stamp = begin_ + lidar_time_->elapsed();
}

std::vector<std::string> RecordedTimes::warnings() const {
  std::vector<std::string> lines = source_->warnings();
  if (lidar_time_)
    lines.push_back(fmt::format(
        "the times of arrival are all the same, so the lidar's own clock tells the time{}",
        is_utc_ ? ", which is UTC by its PPS and GPRMC"
                : ", from the first arrival on; files of other sensors do not fit it: record again with times"));
  return lines;
}

} // namespace locus::tools

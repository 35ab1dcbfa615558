// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/recorded_times.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

#include <fmt/format.h>

namespace locus::tools {
namespace {

constexpr Duration kLongestStep = std::chrono::seconds{1}; ///< between consecutive packets
constexpr Duration kReadAhead = std::chrono::milliseconds{500};

bool has_bytes(const Datagram& datagram) { return datagram.decoded == nullptr && datagram.cloud == nullptr; }

} // namespace

RecordedTimes::RecordedTimes(std::unique_ptr<DatagramSource> source, std::vector<LidarOptions> lidars)
    : source_(std::move(source)), lidars_(std::move(lidars)) {
  for (LidarOptions& lidar : lidars_)
    lidar.time = LidarTime::sensor;
}

const Datagram* RecordedTimes::next() {
  if (!std::exchange(has_looked_ahead_, true))
    look_ahead();
  const Datagram* const datagram = next_unchanged();
  if (datagram == nullptr)
    return nullptr;
  datagram_ = *datagram;
  if (lidar_clock_) {
    lidar_clock_->accept(datagram_);
    datagram_.receive_stamp = begin_ + lidar_clock_->elapsed();
  }
  return &datagram_;
}

const Datagram* RecordedTimes::next_unchanged() {
  if (stored_.empty())
    return source_->next();
  returned_ = std::move(stored_.front());
  stored_.pop_front();
  returned_.datagram.payload = returned_.payload;
  return &returned_.datagram;
}

std::optional<RecordedTimes::LidarClock> RecordedTimes::open_clock() const {
  auto lidars = LidarRouter::open(lidars_);
  return lidars ? std::optional(LidarClock{std::move(*lidars)}) : std::nullopt;
}

/// Reads the first packets and decides whose clock gives their arrival times.
void RecordedTimes::look_ahead() {
  constexpr std::size_t kMostStored = 4'000;
  std::optional<LidarClock> clock = open_clock();
  while (clock && stored_.size() < kMostStored && clock->elapsed() < kReadAhead) {
    const Datagram* const datagram = source_->next();
    if (datagram == nullptr)
      break;
    stored_.push_back({*datagram, {datagram->payload.begin(), datagram->payload.end()}});
    if (!has_bytes(*datagram)) // valid until the next call only
      return;
    clock->accept(*datagram);
  }
  if (!clock || !arrivals_stand_still(*clock))
    return;
  is_utc_ = clock->utc().has_value();
  begin_ = clock->utc().value_or(stored_.front().datagram.receive_stamp);
  lidar_clock_ = open_clock();
}

bool RecordedTimes::arrivals_stand_still(const LidarClock& clock) const {
  constexpr Duration kLeastToJudge = std::chrono::milliseconds{100};
  constexpr int kTooSlow = 100;
  if (clock.elapsed() < kLeastToJudge)
    return false;
  const auto [earliest, latest] =
      std::ranges::minmax(stored_, {}, [](const Stored& stored) { return stored.datagram.receive_stamp; });
  return kTooSlow * (latest.datagram.receive_stamp - earliest.datagram.receive_stamp) < clock.elapsed();
}

void RecordedTimes::LidarClock::accept(Datagram datagram) {
  datagram.receive_stamp = latest_;
  const LidarPacket* const packet = lidars_.receive(datagram);
  if (packet == nullptr || packet->lidar != lidar_.value_or(packet->lidar))
    return;
  const Stamp sent = packet->stamp + packet->duration;
  const bool is_first = !std::exchange(lidar_, packet->lidar).has_value();
  const Duration step = is_first ? Duration{} : sent - latest_;
  const bool is_overtaken = step < Duration{} && step >= -kLongestStep;
  if (is_first)
    first_ = sent;
  if (!is_overtaken)
    latest_ = sent;
  elapsed_ += step <= kLongestStep ? std::max(step, Duration{}) : Duration{};
}

std::optional<Stamp> RecordedTimes::LidarClock::utc() const {
  const auto& position = lidar_ ? lidars_.lidars()[*lidar_].position() : std::nullopt;
  if (!position || !position->is_synchronised() || !position->rmc->date)
    return std::nullopt;
  const Stamp reported =
      Stamp{std::chrono::sys_days{*position->rmc->date}.time_since_epoch()} + position->rmc->time_of_day;
  return first_ + std::chrono::round<std::chrono::hours>(reported - latest_);
}

std::vector<std::string> RecordedTimes::warnings() const {
  std::vector<std::string> lines = source_->warnings();
  if (lidar_clock_)
    lines.push_back(fmt::format(
        "the times of arrival are all the same, so those of the lidar's own clock are used{}",
        is_utc_ ? ", which is UTC by its PPS and GPRMC"
                : ", from the first arrival on; files of other sensors do not match it: record again with times"));
  return lines;
}

} // namespace locus::tools

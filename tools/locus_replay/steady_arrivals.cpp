// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/steady_arrivals.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

#include <fmt/format.h>

#include "bags/reception_order.hpp"
#include "drivers/packet_clock.hpp"

namespace locus::tools {
namespace {

using std::chrono::milliseconds;

constexpr Duration kLongestPause = std::chrono::seconds{1}; ///< between packets that follow each other
constexpr Duration kLeastAhead = milliseconds{100};         ///< shorter ones are left to the delay of the network
constexpr Duration kLookAhead = milliseconds{500};
constexpr Duration kSpan = milliseconds{500};              ///< of the least lateness
constexpr Duration kLongestBreak = std::chrono::hours{24}; ///< between clouds
constexpr std::size_t kMostStored = 20'000;

bool is_packet(const Datagram& datagram) { return datagram.decoded == nullptr && datagram.cloud == nullptr; }

bool is_step(Duration by) { return by >= kLeastAhead || by <= -kLeastStepBack; }

} // namespace

void SteadyArrivals::Sender::restart(Duration at_clock, Stamp at_arrival) {
  clock = at_clock;
  arrival = span_start = at_arrival;
  elapsed = Duration{};
  lowest = previous_lowest = at_arrival.time_since_epoch();
}

void SteadyArrivals::Sender::follow(Duration at_clock, Stamp at_arrival, Duration advance) {
  const Duration late_by = lateness(at_arrival, advance);
  clock = at_clock;
  arrival = at_arrival;
  elapsed += advance;
  if (at_arrival - span_start >= kSpan) {
    previous_lowest = std::exchange(lowest, late_by);
    span_start = at_arrival;
  }
  lowest = std::min(lowest, late_by);
}

const Datagram* SteadyArrivals::next() {
  const Datagram* const unread = stored_.empty() ? source_->next() : nullptr;
  if (unread != nullptr && !jumps(*unread)) {
    datagram_ = *unread;
  } else {
    if (unread != nullptr)
      stored_.push_back({*unread, {unread->payload.begin(), unread->payload.end()}});
    if (stored_.empty())
      return nullptr;
    if (jumps(stored_.front().datagram))
      look_for_step();
    returned_ = std::move(stored_.front());
    stored_.pop_front();
    datagram_ = returned_.datagram;
    datagram_.payload = returned_.payload;
  }
  latest_ = datagram_.receive_stamp;
  datagram_.receive_stamp -= set_by_;
  if (datagram_.cloud != nullptr)
    pass_cloud();
  else
    follow(datagram_);
  return &datagram_;
}

/// Stores the next datagram of the source. What is not bytes is valid until the next call only, so none follows it.
bool SteadyArrivals::store_next() {
  const bool may_read = stored_.empty() || (is_packet(stored_.back().datagram) && stored_.size() < kMostStored);
  const Datagram* const datagram = may_read ? source_->next() : nullptr;
  if (datagram != nullptr)
    stored_.push_back({*datagram, {datagram->payload.begin(), datagram->payload.end()}});
  return datagram != nullptr;
}

Datagram SteadyArrivals::stored(std::size_t i) const {
  Datagram datagram = stored_[i].datagram;
  datagram.payload = stored_[i].payload;
  datagram.receive_stamp -= set_by_;
  return datagram;
}

std::optional<SteadyArrivals::Reading> SteadyArrivals::read(const Datagram& datagram) const {
  if (!is_packet(datagram) || datagram.truncated)
    return std::nullopt;
  const auto clock = clock_in(datagram.payload, lidars_.configured_for(datagram).metadata);
  const std::uint64_t sender = std::uint64_t{datagram.destination_port} << 32 | datagram.source_ip;
  return clock ? std::optional(Reading{sender, *clock}) : std::nullopt;
}

SteadyArrivals::Sender* SteadyArrivals::find(std::uint64_t sender) {
  const auto found = std::ranges::find(senders_, sender, &Sender::key);
  return found != senders_.end() ? &*found : nullptr;
}

void SteadyArrivals::follow(const Datagram& datagram) {
  constexpr std::size_t kMostSenders = 64;
  const auto reading = read(datagram);
  if (!reading)
    return;
  Sender* const sender = find(reading->sender);
  if (sender == nullptr && senders_.size() < kMostSenders) {
    senders_.push_back({.key = reading->sender});
    senders_.back().restart(reading->clock, datagram.receive_stamp);
  } else if (sender != nullptr) {
    const Duration advance = clock_advance(sender->clock, reading->clock);
    if (std::chrono::abs(advance) > kLongestPause)
      sender->restart(reading->clock, datagram.receive_stamp);
    else if (advance > Duration{})
      sender->follow(reading->clock, datagram.receive_stamp, advance);
  }
}

bool SteadyArrivals::jumps(const Datagram& datagram) const {
  return latest_ && is_step(datagram.receive_stamp - *latest_);
}

/// Reads ahead to the first packet whose clock shows whether the host's was set before the first stored datagram.
void SteadyArrivals::look_for_step() {
  constexpr std::size_t kFarthest = 100;
  for (std::size_t i = 0; i < kFarthest && (i < stored_.size() || store_next()); ++i) {
    const auto reading = read(stored(i));
    const Sender* const sender = reading ? find(reading->sender) : nullptr;
    const Duration advance = sender != nullptr ? clock_advance(sender->clock, reading->clock) : Duration{};
    if (advance <= Duration{} || advance > kLongestPause)
      continue;
    if (const auto step = step_from(i, *sender))
      add_step({sender->arrival + advance, *step});
    return;
  }
}

void SteadyArrivals::add_step(ClockStep step) {
  steps_.push_back(step);
  set_by_ += step.by;
}

/// Removes the steps from the cloud in datagram_, after adding one that it shows. A header that continues when the
/// arrivals jump has the interval, and otherwise that of the clouds before it is the usual one.
void SteadyArrivals::pass_cloud() {
  const auto is_usual = [](Duration interval) { return interval > Duration{} && interval <= kLongestPause; };
  Clouds& clouds = clouds_[datagram_.lidar];
  cloud_ = *datagram_.cloud;
  datagram_.cloud = &cloud_;
  const Duration interval = datagram_.receive_stamp - clouds.arrival;
  if (is_usual(interval))
    clouds.interval = interval;
  else if (clouds.interval > Duration{} && (interval <= -kLeastStepBack || interval > kLongestBreak)) {
    const Duration of_headers = cloud_.stamp - clouds.stamp;
    const Duration expected = is_usual(of_headers) ? of_headers : clouds.interval;
    datagram_.receive_stamp = clouds.arrival + expected;
    add_step({datagram_.receive_stamp, interval - expected});
  }
  clouds.arrival = datagram_.receive_stamp;
  clouds.stamp = cloud_.stamp;
  if (cloud_.stamp != Stamp{})
    cloud_.ahead = cloud_.stamp - clouds.headers.pass(cloud_.stamp, steps_);
}

/// Returns the step that a packet shows, together with those of its sender that follow at the same pace.
std::optional<Duration> SteadyArrivals::step_from(std::size_t first, const Sender& sender) {
  const Stamp first_arrival = stored(first).receive_stamp;
  Sender ahead = sender;
  Duration before{}; ///< time of the first packet by its clock, since the sender's latest
  for (std::size_t i = first; i < stored_.size() || store_next(); ++i) {
    const Datagram datagram = stored(i);
    const auto reading = read(datagram);
    if (!reading || reading->sender != sender.key)
      continue;
    const Duration advance = clock_advance(ahead.clock, reading->clock);
    const Duration jump = datagram.receive_stamp - ahead.arrival - advance;
    if (i == first && (!is_step(jump) || (jump < Duration{} && first_arrival >= sender.arrival)))
      return std::nullopt;
    if (i > first && (std::chrono::abs(advance) > kLongestPause || is_step(jump)))
      break;
    if (advance <= Duration{})
      continue;
    if (i == first) {
      before = advance;
      ahead.span_start = first_arrival;
      ahead.lowest = ahead.previous_lowest = Duration::max();
    }
    ahead.follow(reading->clock, datagram.receive_stamp, advance);
    if (ahead.elapsed - sender.elapsed - before >= kLookAhead)
      break;
  }
  const bool is_burst = 2 * (ahead.arrival - first_arrival) < ahead.elapsed - sender.elapsed - before;
  const Duration step = ahead.least() - sender.least();
  return is_step(step) && !is_burst ? std::optional(step) : std::nullopt;
}

std::vector<std::string> SteadyArrivals::warnings() const {
  std::vector<std::string> lines = source_->warnings();
  if (!steps_.empty())
    lines.push_back(fmt::format(
        "the clock of the recording computer was set {}by {:+.3f} s at {:.3f} s: all times continue from before",
        steps_.size() > 1 ? fmt::format("{} times, first ", steps_.size()) : "", to_seconds(steps_.front().by),
        to_seconds(steps_.front().at.time_since_epoch())));
  return lines;
}

} // namespace locus::tools

// SPDX-License-Identifier: Apache-2.0
#include "daemon/input.hpp"

#include <algorithm>
#include <ctime>
#include <thread>
#include <utility>

#include <sys/eventfd.h>
#include <unistd.h>

#include "daemon/machine_time.hpp"

namespace locus::daemon {

namespace {

/// Returns the arrival of a sample; a health verdict has no stamp and applies at once.
Stamp arrival_of(const LiveInput::Motion& motion) {
  if (const auto* imu = std::get_if<ImuInput>(&motion))
    return imu->sample.arrival;
  if (const auto* odometry = std::get_if<OdometryInput>(&motion))
    return odometry->sample.arrival;
  return Stamp::min();
}

/// Applies `change` to a sample; ignores a health verdict.
void modify_sample(LiveInput::Motion& motion, const auto& change) {
  if (auto* imu = std::get_if<ImuInput>(&motion))
    change(imu->source, imu->sample);
  else if (auto* odometry = std::get_if<OdometryInput>(&motion))
    change(odometry->source, odometry->sample);
}

} // namespace

LiveInput::LiveInput(std::vector<UdpSocket> sockets, const std::vector<bool>& gives_clouds)
    : sockets_(std::move(sockets)), guards_(sockets_.size()), waiting_(sockets_.size()),
      received_until_(sockets_.size(), Stamp::min()), wakeup_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
  for (const UdpSocket& socket : sockets_)
    poll_.push_back({socket.descriptor(), POLLIN, 0});
  poll_.push_back({wakeup_, POLLIN, 0});
  for (const bool gives : gives_clouds)
    clouds_.push_back(gives ? std::make_unique<Clouds>() : nullptr);
}

LiveInput::~LiveInput() { close(wakeup_); }

void LiveInput::push(const Motion& motion) noexcept {
  if (!motion_.push(motion))
    motion_drops_.fetch_add(1, std::memory_order_relaxed);
  eventfd_write(wakeup_, 1);
}

void LiveInput::push_cloud(std::uint8_t lidar) noexcept {
  if (clouds_[lidar]->slot.publish())
    clouds_[lidar]->drops.fetch_add(1, std::memory_order_relaxed);
  eventfd_write(wakeup_, 1);
}

/// Collects new clouds; true if any is waiting.
bool LiveInput::poll_clouds() {
  bool any = false;
  for (const auto& clouds : clouds_) {
    if (clouds && clouds->waiting == nullptr)
      clouds->waiting = clouds->slot.poll();
    any = any || (clouds && clouds->waiting != nullptr);
  }
  return any;
}

Input LiveInput::next(Duration timeout) {
  if (!next_motion_)
    next_motion_ = pop_motion();
  time_.detect_step();
  Stamp polled_at;
  if (std::ranges::all_of(waiting_, [](const auto& datagrams) { return datagrams.empty(); }))
    polled_at = receive(next_motion_ || poll_clouds() ? Duration::zero() : timeout);
  Earliest from = earliest();
  if (may_hold_earlier(from.arrival)) {
    receive(Duration::zero());
    from = earliest();
  }
  if (auto input = pop(from))
    return *input;
  return Silence{monotonic(polled_at)};
}

std::optional<LiveInput::Motion> LiveInput::pop_motion() {
  std::optional<Motion> motion = motion_.pop();
  if (!motion)
    return motion;
  time_.detect_step();
  modify_sample(*motion, [this](SourceId source, auto& sample) {
    sample.arrival = time_.to_steady(sample.arrival);
    sample.stamp = time_.to_steady(sample.stamp, sample.arrival, senders_[index_of(source)]);
  });
  return motion;
}

/// Returns an arrival after that of the input returned before. A step of the clock is already undone (SteadyTime), so
/// what is earlier was on its way while its thread, or the kernel's, waited for a processor. A stamp that is earlier by
/// more than any transit shows that the one before it was wrong.
Stamp LiveInput::monotonic(Stamp arrival) {
  const bool late = arrival <= latest_ && latest_ - arrival <= SteadyTime::kMaxTransit;
  return latest_ = late ? latest_ + Duration{1} : arrival;
}

void LiveInput::update_filter(const LidarRouter& lidars) {
  for (std::size_t i = 0; i < sockets_.size(); ++i)
    guards_[i].expect(lidars.senders_to(sockets_[i].port()), sockets_[i]);
}

/// Tells whether a socket without waiting datagrams may hold one earlier than `arrival`; Stamp::max() stands for no
/// input.
bool LiveInput::may_hold_earlier(Stamp arrival) const {
  for (std::size_t i = 0; arrival < Stamp::max() && i < sockets_.size(); ++i)
    if (waiting_[i].empty() && received_until_[i] < arrival)
      return true;
  return false;
}

/// Waits for input, at most for `timeout`, then reads each socket without waiting datagrams. Returns the time at the
/// start of the call: later input has a later arrival.
Stamp LiveInput::receive(Duration timeout) {
  const Stamp wall{read_clock(CLOCK_REALTIME)};
  time_.detect_step();
  const Stamp polled_at = time_.to_steady(wall);
  const timespec wait = to_timespec(timeout);
  const bool has_datagrams = std::ranges::any_of(waiting_, [](const auto& datagrams) { return !datagrams.empty(); });
  const bool is_silent = ppoll(poll_.data(), poll_.size(), &wait, nullptr) == 0 && !has_datagrams;
  std::uint64_t drops = 0, filtered = 0;
  for (std::size_t i = 0; i < sockets_.size(); ++i) {
    if (poll_[i].revents != 0 && waiting_[i].empty()) {
      waiting_[i] = sockets_[i].receive();
      guards_[i].look_at(waiting_[i], sockets_[i]);
    } else if (is_silent) {
      sockets_[i].count_drops(); // a drop causes no wakeup
      guards_[i].advance(Stamp{read_clock(CLOCK_REALTIME)}, sockets_[i]);
    }
    drops += sockets_[i].kernel_drops();
    filtered += sockets_[i].filtered();
  }
  time_.detect_step();
  Stamp received_until = polled_at; // the first datagram of a socket was there when all were polled
  for (const auto& datagrams : waiting_)
    if (!datagrams.empty())
      received_until = std::max(received_until, time_.to_steady(datagrams.front().receive_stamp));
  for (std::size_t i = 0; i < sockets_.size(); ++i)
    received_until_[i] = waiting_[i].empty() ? received_until : time_.to_steady(waiting_[i].back().receive_stamp);
  kernel_drops_.store(drops, std::memory_order_relaxed);
  filtered_.store(filtered, std::memory_order_relaxed);
  if (poll_.back().revents != 0) {
    eventfd_t notifications = 0;
    eventfd_read(wakeup_, &notifications);
  }
  return polled_at;
}

/// Finds the earliest input among those already received.
LiveInput::Earliest LiveInput::earliest() {
  if (!next_motion_)
    next_motion_ = pop_motion();
  Earliest found;
  if (next_motion_)
    found.arrival = arrival_of(*next_motion_);
  poll_clouds();
  for (std::size_t i = 0; i < clouds_.size(); ++i) {
    if (!clouds_[i] || clouds_[i]->waiting == nullptr)
      continue;
    const Stamp arrival = time_.to_steady(clouds_[i]->waiting->arrival);
    if (arrival < found.arrival)
      found = {arrival, std::nullopt, i};
  }
  for (std::size_t i = 0; i < waiting_.size(); ++i) {
    if (waiting_[i].empty())
      continue;
    const Stamp arrival = time_.to_steady(waiting_[i].front().receive_stamp);
    if (arrival < found.arrival)
      found = {arrival, i, std::nullopt};
  }
  return found;
}

std::optional<Input> LiveInput::pop(const Earliest& from) {
  if (from.socket) {
    std::span<const Datagram>& waiting = waiting_[*from.socket];
    Datagram datagram = waiting.front();
    waiting = waiting.subspan(1);
    datagram.receive_stamp = monotonic(from.arrival);
    datagram.clock_set_by = time_.steps();
    return datagram;
  }
  if (from.lidar)
    return pop_cloud(*from.lidar, monotonic(from.arrival));
  if (!next_motion_)
    return std::nullopt;
  modify_sample(*next_motion_, [&](SourceId, auto& sample) { sample.arrival = monotonic(from.arrival); });
  Input input = std::visit([](const auto& motion) { return Input{motion}; }, *next_motion_);
  next_motion_.reset();
  return input;
}

Input LiveInput::pop_cloud(std::size_t lidar, Stamp arrival) {
  Clouds& clouds = *clouds_[lidar];
  const CloudBytes& cloud = *std::exchange(clouds.waiting, nullptr);
  const auto index = static_cast<std::uint8_t>(lidar);
  if (cloud.too_large)
    return CloudInput{index, nullptr, arrival, CloudError::too_large};
  const auto message = read_cloud({cloud.bytes, Serialisation::cdr}, cloud.type);
  if (!message)
    return CloudInput{index, nullptr, arrival, CloudError::cut};
  cloud_ = *message;
  cloud_.ahead = cloud_.stamp - time_.to_steady(cloud_.stamp, arrival, clouds.sender);
  return CloudInput{index, &cloud_, arrival, {}};
}

const PacedInput::Clock PacedInput::kHostClock{[] { return read_clock(CLOCK_MONOTONIC); },
                                               [](Duration time) { std::this_thread::sleep_for(time); }};

void PacedInput::read_ahead() {
  pending_ = PendingInput{recording_.next(Duration::zero()), {}};
  pending_->arrival = arrival_of(pending_->input, last_arrival_);
  if (!started_ || std::chrono::abs(pending_->arrival - last_arrival_) > kMaxPause) {
    anchor_arrival_ = pending_->arrival;
    anchor_clock_ = clock_.now();
    started_ = true;
  }
  last_arrival_ = pending_->arrival;
}

Input PacedInput::next(Duration timeout) {
  if (!pending_)
    read_ahead();
  const Duration due = anchor_clock_ + from_seconds(to_seconds(pending_->arrival - anchor_arrival_) / speed_);
  const Duration remaining = due - clock_.now();
  if (remaining > Duration::zero())
    clock_.sleep_for(std::min(remaining, timeout));
  if (remaining > timeout) {
    const Duration since_anchor = clock_.now() - anchor_clock_;
    return Silence{std::min(pending_->arrival, anchor_arrival_ + from_seconds(speed_ * to_seconds(since_anchor)))};
  }
  Input input = pending_->input;
  pending_.reset();
  return input;
}

} // namespace locus::daemon

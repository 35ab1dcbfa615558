// SPDX-License-Identifier: Apache-2.0
#include "simulated_time/robot_sender.hpp"

#include <algorithm>
#include <ctime>
#include <random>
#include <utility>
#include <variant>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include "daemon/machine_time.hpp"
#include "locus_replay/failure.hpp"

namespace locus::test {
namespace {

using tools::ExitStatus;
using tools::value_or_fail;

constexpr std::uint64_t kImuEvery = 2;       ///< 100 Hz suffice, at half the cost
constexpr std::uint64_t kDuplicateEvery = 5; ///< packets
constexpr std::uint64_t kLateEvery = 20;
constexpr Duration kNotPrepared = std::chrono::seconds{1}; ///< lag counted if nothing is prepared
constexpr double kGarbageHz = 200, kFloodHz = 8000;

int socket_of_a_stranger() {
  const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_in from{};
  from.sin_family = AF_INET;
  from.sin_addr.s_addr = htonl(INADDR_LOOPBACK + 1);
  if (bind(socket, reinterpret_cast<const sockaddr*>(&from), sizeof(from)) != 0)
    throw tools::Failure(ExitStatus::failed, "no socket for garbage");
  return socket;
}

} // namespace

RobotSender::RobotSender(const soak::ClosedCourse& course, const Config& config, tools::MotionPublisher& motion,
                         const ClockFile& clock)
    : lap_(course.lap), config_(config), course_(course, config, 0),
      truth_(value_or_fail(read_trajectory(course.folder / "gt.tum"), ExitStatus::failed)), motion_(motion),
      packets_("127.0.0.1", "lo", value_or_fail(LidarRouter::open(config.lidars), ExitStatus::failed)), clock_(clock),
      garbage_socket_(socket_of_a_stranger()) {
  constexpr Duration kPreparing = std::chrono::seconds{2};
  const Duration begins = daemon::read_clock(CLOCK_REALTIME) - clock_.set_by() + kPreparing;
  shift_ = std::chrono::floor<std::chrono::microseconds>(begins - course_.now().time_since_epoch());
  preparing_ = std::thread([this] { prepare(); });
  thread_ = std::thread([this] { run(); });
}

RobotSender::~RobotSender() {
  stopping_ = true;
  thread_.join();
  preparing_.join();
  close(garbage_socket_);
}

std::optional<Pose> RobotSender::truth_at(Stamp steady) const {
  const Duration since = steady - shift_ - truth_.front().stamp;
  if (since < Duration::zero())
    return std::nullopt;
  const Stamp stamp = truth_.front().stamp + since % lap_;
  const auto after = std::ranges::upper_bound(truth_, stamp, {}, &StampedPose::stamp);
  if (after == truth_.begin() || after == truth_.end())
    return std::nullopt;
  const StampedPose& before = *std::prev(after);
  const double share = to_seconds(stamp - before.stamp) / to_seconds(after->stamp - before.stamp);
  return interpolate(before.T_source_base, after->T_source_base, share);
}

/// Prepares inputs one minute ahead, while the service does not need the processor: starting a lap takes long.
void RobotSender::prepare() {
  constexpr std::size_t kAhead = 60'000;
  const sched_param ordinary{0};
  sched_setscheduler(0, SCHED_OTHER, &ordinary); // this thread only, on Linux; so does the next
  setpriority(PRIO_PROCESS, 0, -20);
  course_.begin_lap({});
  while (!stopping_) {
    if (course_.is_at_rest())
      course_.begin_lap({});
    Prepared next{course_.next({}), {}};
    if (std::holds_alternative<daemon::Silence>(next.input))
      continue;
    if (auto* datagram = std::get_if<Datagram>(&next.input))
      next.payload.assign(datagram->payload.begin(), datagram->payload.end());
    std::unique_lock lock(mutex_);
    while (prepared_.size() >= kAhead && !stopping_)
      changed_.wait_for(lock, std::chrono::milliseconds{100});
    prepared_.push_back(std::move(next));
  }
}

std::optional<RobotSender::Prepared> RobotSender::take_prepared() {
  const std::scoped_lock lock(mutex_);
  if (prepared_.empty())
    return std::nullopt;
  Prepared next = std::move(prepared_.front());
  prepared_.pop_front();
  return next;
}

/// Includes the input that is still being sent.
Duration RobotSender::worst_lag() {
  const Duration now = daemon::read_clock(CLOCK_REALTIME) - clock_.set_by();
  const Duration unfinished = due_ns_ == 0 ? Duration{} : now - Duration{due_ns_};
  return std::max(Duration{worst_lag_ns_.exchange(0)}, unfinished);
}

/// Sends each input when it is due, at real-time priority: real sensors do not share a processor with the service.
void RobotSender::run() {
  const sched_param before_all{5};
  sched_setscheduler(0, SCHED_FIFO, &before_all); // this thread only, if permitted
  while (!stopping_) {
    std::optional<Prepared> next = take_prepared();
    if (!next) {
      worst_lag_ns_ = Duration{kNotPrepared}.count();
      std::this_thread::sleep_for(std::chrono::milliseconds{1});
      continue;
    }
    if (auto* datagram = std::get_if<Datagram>(&next->input))
      datagram->payload = next->payload;
    const Duration due = daemon::arrival_of(next->input, {}).time_since_epoch() + shift_;
    due_ns_ = due.count();
    const auto late = [&] { return daemon::read_clock(CLOCK_REALTIME) - clock_.set_by() - due; };
    if (const Duration early = -late(); early > Duration::zero())
      std::this_thread::sleep_for(early);
    worst_lag_ns_ = std::max(worst_lag_ns_.load(), late().count());
    send(next->input);
    send_garbage();
  }
}

/// Stamps motion samples by the host's clock, including its steps.
void RobotSender::send(const daemon::Input& input) {
  const Duration by_host = shift_ + clock_.set_by();
  if (const auto* datagram = std::get_if<Datagram>(&input))
    send(*datagram);
  else if (const auto* imu = std::get_if<daemon::ImuInput>(&input);
           imu && !is_on(DayFault::imu_lost) && ++imus_ % kImuEvery == 0)
    motion_.publish(*imu, by_host);
  else if (const auto* odometry = std::get_if<daemon::OdometryInput>(&input);
           odometry && !is_on(DayFault::odometry_lost))
    motion_.publish(*odometry, by_host);
}

void RobotSender::send(const Datagram& datagram) {
  if (is_on(DayFault::lidar_lost))
    return;
  ++number_;
  if (is_on(DayFault::late) && held_back_.empty() && number_ % kLateEvery == 0) {
    held_back_.assign(datagram.payload.begin(), datagram.payload.end());
    held_datagram_ = datagram;
    return;
  }
  for (int i = 0; i < (is_on(DayFault::duplicates) && number_ % kDuplicateEvery == 0 ? 2 : 1); ++i, ++sent_)
    packets_.send(datagram, shift_);
  send_late();
}

void RobotSender::send_late() {
  if (held_back_.empty())
    return;
  held_datagram_.payload = held_back_;
  packets_.send(held_datagram_, shift_);
  ++sent_;
  held_back_.clear();
}

/// Sends the garbage that is due since the previous call.
void RobotSender::send_garbage() {
  const Duration now = daemon::read_clock(CLOCK_MONOTONIC);
  const double rate_hz = is_on(DayFault::flood) ? kFloodHz : is_on(DayFault::garbage) ? kGarbageHz : 0;
  if (rate_hz == 0 || now - garbage_until_ > std::chrono::milliseconds{100})
    garbage_until_ = now;
  static std::minstd_rand random(1);
  static const std::array<std::byte, 1500> kJunk = [] {
    std::array<std::byte, 1500> junk{};
    std::ranges::generate(junk, [] { return static_cast<std::byte>(random()); });
    return junk;
  }();
  for (; rate_hz > 0 && garbage_until_ < now; garbage_until_ += from_seconds(1 / rate_hz)) {
    const auto dice = static_cast<std::size_t>(random());
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(dice % 8 == 0 ? kDefaultPositionPort : config_.lidars.front().port);
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const std::array<std::size_t, 4> lengths{1206, 512, 0, dice % kJunk.size()};
    if (sendto(garbage_socket_, kJunk.data(), lengths[dice / 8 % lengths.size()], 0,
               reinterpret_cast<const sockaddr*>(&to), sizeof(to)) >= 0)
      ++sent_;
  }
}

} // namespace locus::test

// SPDX-License-Identifier: Apache-2.0
#include "daemon/input.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <ctime>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <linux/sock_diag.h>
#include <sys/socket.h>

#include "daemon/allocation_counter.hpp"
#include "daemon/machine_time.hpp"
#include "support/kernel_stamps.hpp"
#include "support/patience.hpp"
#include "support/temporary_file.hpp"
#include "support/udp_sender.hpp"

namespace locus::daemon {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::seconds;

std::vector<UdpSocket> two_sockets() {
  std::vector<UdpSocket> sockets;
  for (int i = 0; i < 2; ++i)
    sockets.push_back(std::move(*UdpSocket::open(0)));
  return sockets;
}

/// Sends a datagram and waits until the socket has it: on a busy machine a kernel thread delivers it later.
void bring(const UdpSocket& socket, std::span<const std::byte> payload, const test::UdpSender& sender) {
  const auto held = [&] {
    std::array<std::uint32_t, SK_MEMINFO_VARS> figures{};
    socklen_t size = sizeof(figures);
    EXPECT_EQ(getsockopt(socket.descriptor(), SOL_SOCKET, SO_MEMINFO, figures.data(), &size), 0);
    return figures[SK_MEMINFO_RMEM_ALLOC];
  };
  const std::uint32_t before = held();
  sender.send(socket.port(), payload);
  const Duration give_up = read_clock(CLOCK_MONOTONIC) + test::patience();
  while (held() == before && read_clock(CLOCK_MONOTONIC) < give_up)
    std::this_thread::yield();
}

Stamp now() { return Stamp{read_clock(CLOCK_REALTIME)}; }

ImuInput imu_at(Stamp arrival) {
  ImuInput input{SourceId{1}, {}};
  input.sample.arrival = arrival;
  return input;
}

TEST(LiveInput, ReturnsDatagramsAndMotionInOrderOfArrival) {
  const test::KernelStamps stamps;
  LiveInput input(two_sockets());
  const test::UdpSender sender;
  const UdpSocket &first = input.sockets()[0], &second = input.sockets()[1];
  bring(second, test::bytes_of("a"), sender);
  const Stamp between = now();
  bring(first, test::bytes_of("b"), sender);
  bring(second, test::bytes_of("c"), sender);
  input.push(imu_at(between));

  std::vector<std::uint16_t> ports;
  for (int i = 0; i < 4; ++i) {
    const Input next = input.next(milliseconds{100});
    if (const auto* datagram = std::get_if<Datagram>(&next))
      ports.push_back(datagram->destination_port);
    else if (std::holds_alternative<ImuInput>(next))
      ports.push_back(0);
  }
  EXPECT_EQ(ports, (std::vector<std::uint16_t>{second.port(), 0, first.port(), second.port()}));
  EXPECT_TRUE(std::holds_alternative<Silence>(input.next(milliseconds{1})));
}

/// Sockets return 32 datagrams at a time: those of the lidar span a short time, its position packets a long one. After
/// a stall, unsorted batches would make time jump ahead and back.
TEST(LiveInput, BacklogAfterAStallIsInOrderOfArrival) {
  const test::KernelStamps stamps;
  LiveInput input(two_sockets());
  const test::UdpSender sender;
  const UdpSocket &data = input.sockets()[0], &position = input.sockets()[1];
  std::vector<std::uint16_t> sent, received;
  for (int i = 0; i < 200; ++i) {
    bring(data, test::bytes_of("data"), sender);
    sent.push_back(data.port());
    if (i % 5 == 0) {
      bring(position, test::bytes_of("position"), sender);
      sent.push_back(position.port());
    }
    if (i % 50 == 0) {
      input.push(imu_at(now()));
      sent.push_back(0);
    }
  }
  Stamp last;
  for (std::size_t i = 0; i < sent.size(); ++i) {
    const Input next = input.next(test::patience());
    const auto* datagram = std::get_if<Datagram>(&next);
    received.push_back(datagram != nullptr ? datagram->destination_port : 0);
    EXPECT_GT(arrival_of(next, {}), last) << i;
    last = arrival_of(next, {});
  }
  EXPECT_EQ(received, sent);
}

TEST(LiveInput, SilenceIsNeverLaterThanTheNextInput) {
  LiveInput input(two_sockets());
  const std::uint16_t port = input.sockets()[0].port();
  std::thread robot([port] {
    const test::UdpSender sender;
    for (int i = 0; i < 100; ++i) {
      sender.send(port, test::bytes_of("x"));
      std::this_thread::sleep_for(milliseconds{3});
    }
  });
  Stamp silent_until;
  int datagrams = 0;
  const Stamp give_up = now() + test::patience();
  while (datagrams < 100 && now() < give_up) {
    const Input next = input.next(milliseconds{2});
    if (const auto* silence = std::get_if<Silence>(&next)) {
      silent_until = silence->now;
    } else {
      ++datagrams;
      EXPECT_GE(std::get<Datagram>(next).receive_stamp, silent_until);
    }
  }
  robot.join();
  EXPECT_EQ(datagrams, 100);
}

TEST(LiveInput, MotionWakesTheWaitingThread) {
  LiveInput input(two_sockets());
  std::thread reader([&] {
    std::this_thread::sleep_for(milliseconds{50});
    input.push(imu_at(now()));
  });
  EXPECT_TRUE(std::holds_alternative<ImuInput>(input.next(test::patience())));
  reader.join();
}

/// Late motion arrives just after the last input returned, so that a recording preserves the order. A thread that waits
/// for a processor hands over a sample a time slice late, 100 ms beside a load of 25. An hour late is a clock step and
/// passes unchanged.
TEST(LiveInput, LateMotionArrivesAfterTheInputReturnedBefore) {
  const test::KernelStamps stamps;
  LiveInput input(two_sockets());
  const test::UdpSender sender;
  sender.send(input.sockets()[0].port(), test::bytes_of("a"));
  const Input first = input.next(test::patience());
  const Stamp given_out = std::get<Datagram>(first).receive_stamp;
  constexpr std::array<Duration, 5> kLate{milliseconds{3}, milliseconds{2}, milliseconds{60}, milliseconds{1900},
                                          hours{1}};
  for (const Duration late : kLate)
    input.push(imu_at(given_out - late));
  const auto next_arrival = [&] { return std::get<ImuInput>(input.next(test::patience())).sample.arrival; };
  for (int i = 1; i <= 4; ++i)
    EXPECT_EQ(next_arrival(), given_out + Duration{i});
  EXPECT_EQ(next_arrival(), given_out - hours{1});
}

TEST(LiveInput, UnfetchedMotionIsCounted) {
  LiveInput input(two_sockets());
  for (std::size_t i = 0; i < LiveInput::kMaxUnread + 7; ++i)
    input.push(imu_at(now()));
  EXPECT_EQ(input.motion_drops(), 7U);
}

/// After a flood, whether it ended or overflowed the buffer, no further datagram wakes the thread.
TEST(LiveInput, KernelFilteredDatagramsAreCountedWithoutFurtherInput) {
  LiveInput input(two_sockets());
  const test::UdpSender sender;
  const std::vector<std::byte> foreign(700);
  std::uint64_t sent = 0, received = 0;
  const Stamp give_up = now() + test::patience();
  const auto flood = [&](std::uint64_t datagrams) {
    for (std::uint64_t i = 0; i < datagrams; ++i, ++sent)
      sender.send(input.sockets()[0].port(), foreign);
    const auto accounted = [&] { return received + input.filtered() + input.kernel_drops(); };
    while (accounted() < sent && now() < give_up)
      received += std::holds_alternative<Silence>(input.next(milliseconds{10})) ? 0U : 1U;
    EXPECT_EQ(accounted(), sent);
  };
  for (int guarded = 0; guarded < 20 && now() < give_up;) { // the filter stays for a second after a flood
    const std::uint64_t before = input.filtered();
    flood(10);
    if (input.filtered() > before)
      ++guarded;
    else
      flood(2 * FloodGuard::kFlood);
  }
  EXPECT_GT(input.filtered(), 100U) << "the guard stands";
}

TEST(LiveInput, AllocatesNothing) {
  if (!allocations())
    GTEST_SKIP() << "a sanitizer is in the way of counting";
  LiveInput input(two_sockets());
  const test::UdpSender sender;
  const std::vector<std::byte> packet(1206);
  int taken = 0;
  const auto before = allocations();
  for (int i = 0; i < 1000; ++i) {
    sender.send(input.sockets()[static_cast<std::size_t>(i % 2)].port(), packet);
    input.push(imu_at(Stamp{}));
    for (int k = 0; k < 2; ++k)
      taken += std::holds_alternative<Silence>(input.next(test::patience())) ? 0 : 1;
  }
  EXPECT_EQ(allocations(), before);
  EXPECT_EQ(taken, 2000);
}

/// Serialises a sensor_msgs/PointCloud2 with one point.
std::vector<std::byte> cloud_message(Stamp stamp) {
  std::vector<std::byte> bytes(4);
  bytes[1] = std::byte{1}; // little-endian CDR
  const auto put = [&](std::uint32_t number) {
    bytes.resize((bytes.size() + 3) / 4 * 4);
    for (std::size_t i = 0; i < 4; ++i)
      bytes.push_back(static_cast<std::byte>(number >> (8 * i)));
  };
  const auto put_text = [&](const std::string& text) {
    put(static_cast<std::uint32_t>(text.size() + 1));
    for (const char c : text)
      bytes.push_back(static_cast<std::byte>(c));
    bytes.push_back(std::byte{0});
  };
  put(static_cast<std::uint32_t>(to_ns(stamp) / 1'000'000'000));
  put(static_cast<std::uint32_t>(to_ns(stamp) % 1'000'000'000));
  put_text("lidar");
  put(1); // height, width, fields
  put(1);
  put(3);
  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    put_text(std::string(1, static_cast<char>('x' + axis)));
    put(4 * axis);
    bytes.push_back(static_cast<std::byte>(CloudView::Type::float32));
    put(1);
  }
  bytes.push_back(std::byte{0});                                 // little-endian
  for (const std::uint32_t number : {12U, 12U, 12U, 1U, 2U, 3U}) // point step, row step, data size, one point
    put(number);
  bytes.push_back(std::byte{1}); // dense
  return bytes;
}

/// An input whose only lidar publishes clouds, with a socket of another.
class LiveInputClouds : public testing::Test {
 protected:
  void hand_over(Stamp arrival, std::span<const std::byte> message) {
    CloudBytes& next = input_.next_cloud(0);
    next.arrival = arrival;
    next.too_large = false;
    next.bytes.assign(message.begin(), message.end());
    input_.push_cloud(0);
  }

  LiveInput input_{two_sockets(), {true, false}};
  test::UdpSender sender_;
};

TEST_F(LiveInputClouds, AreInOrderOfArrivalWithDatagramsAndMotion) {
  const test::KernelStamps stamps;
  bring(input_.sockets()[0], test::bytes_of("a"), sender_);
  const Stamp cloud = now();
  const Stamp motion = cloud + Duration{1000};
  std::this_thread::sleep_for(milliseconds{1});
  bring(input_.sockets()[0], test::bytes_of("b"), sender_);
  input_.push(imu_at(motion));
  hand_over(cloud, cloud_message(cloud - milliseconds{100}));

  std::vector<std::string> order;
  Stamp last{};
  for (int i = 0; i < 4; ++i) {
    const Input next = input_.next(milliseconds{100});
    const auto* given = std::get_if<CloudInput>(&next);
    order.emplace_back(given != nullptr                         ? "cloud"
                       : std::holds_alternative<ImuInput>(next) ? "motion"
                       : std::holds_alternative<Datagram>(next) ? "datagram"
                                                                : "silence");
    EXPECT_GT(arrival_of(next, {}), last) << i;
    last = arrival_of(next, {});
    if (given == nullptr)
      continue;
    ASSERT_NE(given->message, nullptr);
    EXPECT_EQ(given->lidar, 0);
    EXPECT_EQ(given->arrival, cloud);
    EXPECT_EQ(given->message->stamp - given->message->ahead, cloud - milliseconds{100});
    EXPECT_EQ(given->message->fields().size(), 3U);
    EXPECT_EQ(given->message->data.size(), 12U);
  }
  EXPECT_EQ(order, (std::vector<std::string>{"datagram", "cloud", "motion", "datagram"}));
  EXPECT_TRUE(std::holds_alternative<Silence>(input_.next(milliseconds{1})));
}

TEST_F(LiveInputClouds, WakeTheWaitingThread) {
  std::thread reader([&] {
    std::this_thread::sleep_for(milliseconds{50});
    hand_over(now(), cloud_message(now()));
  });
  EXPECT_TRUE(std::holds_alternative<CloudInput>(input_.next(test::patience())));
  reader.join();
}

TEST_F(LiveInputClouds, UnfetchedOnesAreCountedAndTheNewestRemains) {
  const Stamp first = now();
  for (int i = 0; i < 5; ++i)
    hand_over(first + milliseconds{i}, cloud_message(first + milliseconds{i}));
  EXPECT_EQ(input_.cloud_drops(0), 4U);
  EXPECT_EQ(input_.cloud_drops(1), 0U) << "it gives none";
  const Input next = input_.next(milliseconds{100});
  ASSERT_TRUE(std::holds_alternative<CloudInput>(next));
  EXPECT_EQ(std::get<CloudInput>(next).arrival, first + milliseconds{4});
  EXPECT_TRUE(std::holds_alternative<Silence>(input_.next(milliseconds{1})));
}

TEST_F(LiveInputClouds, UnreadableOnesCarryTheReason) {
  const auto error = [&] {
    const Input next = input_.next(milliseconds{100});
    const auto* cloud = std::get_if<CloudInput>(&next);
    return cloud != nullptr && cloud->message == nullptr ? std::optional{cloud->error} : std::nullopt;
  };
  const std::vector<std::byte> whole = cloud_message(now());
  for (std::size_t size = 0; size + 1 < whole.size(); ++size) { // the last byte, is_dense, is not read
    hand_over(now(), std::span(whole).first(size));
    EXPECT_EQ(error(), CloudError::cut) << size;
  }
  CloudBytes& large = input_.next_cloud(0);
  large.arrival = now();
  large.too_large = true;
  large.bytes.clear();
  input_.push_cloud(0);
  EXPECT_EQ(error(), CloudError::too_large);
  hand_over(now(), whole);
  EXPECT_TRUE(std::holds_alternative<CloudInput>(input_.next(milliseconds{100})));
}

TEST_F(LiveInputClouds, AllocateNothingAfterTheLargest) {
  if (!allocations())
    GTEST_SKIP() << "a sanitizer is in the way of counting";
  const std::vector<std::byte> message = cloud_message(now());
  const auto play = [&] {
    int taken = 0;
    for (int i = 0; i < 100; ++i) {
      hand_over(now(), message);
      taken += std::holds_alternative<CloudInput>(input_.next(milliseconds{1})) ? 1 : 0;
    }
    return taken;
  };
  EXPECT_EQ(play(), 100);
  const auto before = allocations();
  EXPECT_EQ(play(), 100);
  EXPECT_EQ(allocations(), before);
}

constexpr Stamp kStart = stamp_from_ns(1'700'000'000'000'000'000);

/// Datagrams that arrive at the given stamps.
class Recording : public InputSource {
 public:
  explicit Recording(std::vector<Stamp> arrivals) : arrivals_(std::move(arrivals)) {}
  Input next(Duration) override {
    if (given_ == arrivals_.size())
      return EndOfInput{};
    Datagram datagram;
    datagram.receive_stamp = arrivals_[given_++];
    return datagram;
  }

 private:
  std::vector<Stamp> arrivals_;
  std::size_t given_ = 0;
};

/// Simulated clock that advances only by sleeping, slightly longer than requested.
class SleepingClock {
 public:
  static constexpr Duration kOversleeps = std::chrono::microseconds{100};
  static Duration now() { return now_; }
  static void sleep_for(Duration time) { now_ += time + kOversleeps; }
  static constexpr PacedInput::Clock kClock{now, sleep_for};

 private:
  static inline Duration now_{};
};

struct Heard {
  Input input;
  Duration after; ///< the first
};

std::vector<Heard> listen(PacedInput& input) {
  std::vector<Heard> heard;
  const Duration begin = SleepingClock::now();
  do
    heard.push_back({input.next(milliseconds{2}), SleepingClock::now() - begin});
  while (!std::holds_alternative<EndOfInput>(heard.back().input));
  return heard;
}

TEST(PacedInput, ReturnsEachInputWhenDue) {
  Recording recording({kStart, kStart + milliseconds{40}, kStart + milliseconds{60}});
  PacedInput paced(recording, 2.0, SleepingClock::kClock);
  std::size_t datagrams = 0;
  for (const Heard& heard : listen(paced)) {
    const auto* datagram = std::get_if<Datagram>(&heard.input);
    if (datagram == nullptr)
      continue;
    ++datagrams;
    const Duration due = (datagram->receive_stamp - kStart) / 2;
    EXPECT_GE(heard.after, due);
    EXPECT_LE(heard.after, due + SleepingClock::kOversleeps);
  }
  EXPECT_EQ(datagrams, 3U);
}

TEST(PacedInput, SilenceAdvancesAndIsNeverLaterThanTheNextArrival) {
  const Stamp last = kStart + milliseconds{60};
  Recording recording({kStart, last});
  PacedInput paced(recording, 1.0, SleepingClock::kClock);
  std::vector<Stamp> silences;
  for (const Heard& heard : listen(paced))
    if (const auto* silence = std::get_if<Silence>(&heard.input)) {
      silences.push_back(silence->now);
      EXPECT_EQ(silence->now, std::min(kStart + heard.after, last));
    }
  ASSERT_EQ(silences.size(), 28U) << "each of 2.1 ms";
  EXPECT_GT(silences.front(), kStart);
  EXPECT_GT(silences.back(), silences.front());
  EXPECT_LE(silences.back(), last);
}

TEST(PacedInput, ClockJumpIsSkippedAndThePaceContinues) {
  const Stamp later = kStart + hours{1};
  Recording recording({kStart, later, later + milliseconds{30}, kStart, kStart + milliseconds{30}});
  PacedInput paced(recording, 1.0, SleepingClock::kClock);
  const Duration end = listen(paced).back().after;
  EXPECT_GE(end, milliseconds{60});
  EXPECT_LE(end, milliseconds{60} + 2 * SleepingClock::kOversleeps);
}

/// The default clock is the host's.
TEST(PacedInput, IsPacedByTheClockOfTheHost) {
  Recording recording({kStart, kStart + milliseconds{20}});
  PacedInput paced(recording, 1.0);
  const Duration begin = read_clock(CLOCK_MONOTONIC);
  EXPECT_TRUE(std::holds_alternative<Datagram>(paced.next(seconds{1})));
  EXPECT_TRUE(std::holds_alternative<Datagram>(paced.next(seconds{1})));
  EXPECT_GE(read_clock(CLOCK_MONOTONIC) - begin, milliseconds{20});
}

} // namespace
} // namespace locus::daemon

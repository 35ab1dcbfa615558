// SPDX-License-Identifier: Apache-2.0
#include "daemon/input.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cstddef>
#include <ctime>
#include <thread>
#include <utility>
#include <vector>

#include "daemon/allocation_counter.hpp"
#include "daemon/machine_time.hpp"
#include "support/kernel_stamps.hpp"
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

Stamp now() { return Stamp{read_clock(CLOCK_REALTIME)}; }

ImuInput imu_at(Stamp arrival) {
  ImuInput input{SourceId{1}, {}};
  input.sample.arrival = arrival;
  return input;
}

TEST(LiveInput, GivesSocketsAndMotionInTheOrderOfArrival) {
  const test::KernelStamps stamps;
  LiveInput input(two_sockets());
  const test::UdpSender sender;
  const std::uint16_t first = input.sockets()[0].port(), second = input.sockets()[1].port();
  sender.send(second, test::bytes_of("a"));
  const Stamp between = now();
  std::this_thread::sleep_for(milliseconds{1});
  sender.send(first, test::bytes_of("b"));
  sender.send(second, test::bytes_of("c"));
  input.push(imu_at(between));

  std::vector<std::uint16_t> ports;
  for (int i = 0; i < 4; ++i) {
    const Input next = input.next(milliseconds{100});
    if (const auto* datagram = std::get_if<Datagram>(&next))
      ports.push_back(datagram->destination_port);
    else if (std::holds_alternative<ImuInput>(next))
      ports.push_back(0);
  }
  EXPECT_EQ(ports, (std::vector<std::uint16_t>{second, 0, first, second}));
  EXPECT_TRUE(std::holds_alternative<Silence>(input.next(milliseconds{1})));
}

TEST(LiveInput, SilenceIsNeverLaterThanWhatComesNext) {
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
  const Stamp give_up = now() + seconds{20};
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
  const Duration begin = read_clock(CLOCK_MONOTONIC);
  EXPECT_TRUE(std::holds_alternative<ImuInput>(input.next(seconds{10})));
  EXPECT_LT(read_clock(CLOCK_MONOTONIC) - begin, seconds{5});
  reader.join();
}

/// In the order in which they were given out, a recording of the inputs gives them out again. A clock that is set back
/// by an hour is none of this.
TEST(LiveInput, MotionThatIsHandedOverLateArrivesAfterWhatWasGivenOut) {
  const test::KernelStamps stamps;
  LiveInput input(two_sockets());
  const test::UdpSender sender;
  sender.send(input.sockets()[0].port(), test::bytes_of("a"));
  const Input first = input.next(seconds{10});
  const Stamp given_out = std::get<Datagram>(first).receive_stamp;
  for (const Duration late : {Duration{milliseconds{3}}, Duration{milliseconds{2}}, Duration{seconds{3600}}})
    input.push(imu_at(given_out - late));
  const auto next_arrival = [&] { return std::get<ImuInput>(input.next(seconds{10})).sample.arrival; };
  EXPECT_EQ(next_arrival(), given_out + Duration{1});
  EXPECT_EQ(next_arrival(), given_out + Duration{2});
  EXPECT_EQ(next_arrival(), given_out - seconds{3600});
}

TEST(LiveInput, MotionThatNobodyFetchesIsCounted) {
  LiveInput input(two_sockets());
  for (std::size_t i = 0; i < LiveInput::kMaxUnread + 7; ++i)
    input.push(imu_at(now()));
  EXPECT_EQ(input.motion_drops(), 7U);
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
      taken += std::holds_alternative<Silence>(input.next(milliseconds{1})) ? 0 : 1;
  }
  EXPECT_EQ(allocations(), before);
  EXPECT_EQ(taken, 2000);
}

constexpr Stamp kStart = stamp_from_ns(1'700'000'000'000'000'000);

/// Datagrams that arrive at the stamps given.
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

struct Heard {
  Input input;
  Duration after; ///< the first
};

std::vector<Heard> listen(PacedInput& input) {
  std::vector<Heard> heard;
  const Duration begin = read_clock(CLOCK_MONOTONIC);
  do
    heard.push_back({input.next(milliseconds{2}), read_clock(CLOCK_MONOTONIC) - begin});
  while (!std::holds_alternative<EndOfInput>(heard.back().input));
  return heard;
}

TEST(PacedInput, NothingComesBeforeItIsDue) {
  Recording recording({kStart, kStart + milliseconds{40}, kStart + milliseconds{60}});
  PacedInput paced(recording, 2.0);
  std::size_t datagrams = 0;
  for (const Heard& heard : listen(paced)) {
    const auto* datagram = std::get_if<Datagram>(&heard.input);
    if (datagram == nullptr)
      continue;
    ++datagrams;
    EXPECT_GE(heard.after + milliseconds{1}, (datagram->receive_stamp - kStart) / 2);
  }
  EXPECT_EQ(datagrams, 3U);
}

TEST(PacedInput, SilenceTellsATimeThatRunsAndIsNeverLaterThanTheNextArrival) {
  const Stamp last = kStart + milliseconds{60};
  Recording recording({kStart, last});
  PacedInput paced(recording, 1.0);
  std::vector<Stamp> silences;
  for (const Heard& heard : listen(paced))
    if (const auto* silence = std::get_if<Silence>(&heard.input))
      silences.push_back(silence->now);
  ASSERT_GE(silences.size(), 2U);
  EXPECT_GT(silences.front(), kStart);
  EXPECT_GT(silences.back(), silences.front());
  EXPECT_LE(silences.back(), last);
}

TEST(PacedInput, JumpOfTheClockIsNotWaitedForAndThePaceGoesOnAfterIt) {
  const Stamp later = kStart + hours{1};
  Recording recording({kStart, later, later + milliseconds{30}, kStart, kStart + milliseconds{30}});
  PacedInput paced(recording, 1.0);
  const Duration end = listen(paced).back().after;
  EXPECT_GE(end, milliseconds{59});
  EXPECT_LT(end, seconds{20});
}

} // namespace
} // namespace locus::daemon

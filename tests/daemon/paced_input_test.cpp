// SPDX-License-Identifier: Apache-2.0
#include "daemon/paced_input.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cstddef>
#include <ctime>
#include <utility>
#include <vector>

#include "daemon/machine_time.hpp"

namespace locus::daemon {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::seconds;

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

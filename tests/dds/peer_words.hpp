// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <string>
#include <thread>
#include <utility>

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

/// Common parts of the test peers: programs in another process that print received messages line by line on stdout and
/// run until their stdin is closed.
namespace locus::test {

/// Returns CLOCK_REALTIME, on which stamps are.
inline std::int64_t realtime_ns() {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

template <class... Values> void tell(fmt::format_string<Values...> format, Values&&... values) {
  fmt::print("{}\n", fmt::format(format, std::forward<Values>(values)...));
  std::fflush(stdout);
}

template <class Bytes> std::string hex(const Bytes& bytes) { return fmt::format("{:02x}", fmt::join(bytes, "")); }

inline bool stdin_is_open() {
  pollfd input{STDIN_FILENO, POLLIN, 0};
  if (poll(&input, 1, 0) <= 0)
    return true;
  char byte = 0;
  return read(STDIN_FILENO, &byte, 1) > 0;
}

/// Content of message `i` of a talking peer: stamp and figure identify it.
struct Said {
  static constexpr std::int32_t kSec = 1'700'000'000;
  std::int32_t sec;
  std::uint32_t nanosec;
  double figure; ///< i / 8: exact in binary

  explicit Said(int i)
      : sec(kSec + i / 100), nanosec(static_cast<std::uint32_t>(i % 100) * 10'000'000U), figure(i / 8.0) {}
};

/// Calls `say(i)` a hundred times a second until stdin is closed.
template <class Say> void talk_on(const Say& say) {
  for (int i = 0; stdin_is_open(); ++i) {
    say(i);
    std::this_thread::sleep_for(std::chrono::milliseconds{10});
  }
}

/// Calls `say(sec, nanosec)` ten times a second with the time 0.1 s ago, until stdin is closed; then prints the number
/// of calls.
template <class Say> void talk_of_turns(const Say& say) {
  constexpr std::int64_t kSecond_ns = 1'000'000'000, kTurn_ns = kSecond_ns / 10;
  int said = 0;
  for (std::int64_t due_ns = realtime_ns(); stdin_is_open(); due_ns += kTurn_ns) {
    std::this_thread::sleep_for(std::chrono::nanoseconds{due_ns - realtime_ns()});
    const std::int64_t begin_ns = realtime_ns() - kTurn_ns;
    say(static_cast<std::int32_t>(begin_ns / kSecond_ns), static_cast<std::uint32_t>(begin_ns % kSecond_ns));
    ++said;
  }
  tell("said {}", said);
}

} // namespace locus::test

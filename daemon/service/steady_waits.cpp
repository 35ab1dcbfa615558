// SPDX-License-Identifier: Apache-2.0
// Cyclone DDS 0.10 waits until a wall-clock time. If the clock is set back by an hour, each such wait takes an hour
// longer, which stalls all DDS activity: heartbeats, discovery, and the waits of our own thread. (Later versions wait
// on the monotonic clock; remove this file when Debian has one.) This function therefore replaces the C library's: it
// waits for the time that remains when the wait begins.
#include <algorithm>
#include <cerrno>
#include <chrono>
#include <ctime>

#include <pthread.h>

#include "daemon/machine_time.hpp"

#ifdef __has_feature
#if __has_feature(thread_sanitizer)
#define LOCUS_WAITS_ARE_WATCHED // the sanitizer interposes the same function
#endif
#endif

#ifndef LOCUS_WAITS_ARE_WATCHED

/// Waits on the monotonic clock. `until` is on the clock, wall or monotonic, to which it is nearer; libraries differ.
// The header has reserved names. NOLINTNEXTLINE(readability-inconsistent-declaration-parameter-name)
extern "C" int pthread_cond_timedwait(pthread_cond_t* condition, pthread_mutex_t* mutex, const timespec* until) {
  using namespace locus;
  constexpr std::time_t kNever = 5'000'000'000; // in 2128; in nanoseconds it fits
  if (until->tv_nsec < 0 || until->tv_nsec >= 1'000'000'000)
    return EINVAL;
  const Duration end = std::chrono::seconds{std::clamp(until->tv_sec, -kNever, kNever)} + Duration{until->tv_nsec};
  const Duration steady_now = daemon::read_clock(CLOCK_MONOTONIC);
  const Duration by_wall = end - daemon::read_clock(CLOCK_REALTIME), by_steady = end - steady_now;
  const Duration left = std::chrono::abs(by_wall) < std::chrono::abs(by_steady) ? by_wall : by_steady;
  const timespec steady_end = daemon::to_timespec(steady_now + std::max(left, Duration::zero()));
  return pthread_cond_clockwait(condition, mutex, CLOCK_MONOTONIC, &steady_end);
}

#endif

// SPDX-License-Identifier: Apache-2.0
// LD_PRELOAD library that replaces the clocks of a program by those of the file SIMULATED_CLOCK (simulated_clock.hpp):
// all run faster than the system's, and the wall clock can be stepped. Clocks, datagram stamps and waits are
// consistent. Waits until a wall-clock time follow a step, as in the kernel. CPU time is unchanged.
#include "support/simulated_clock.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>

#include <dlfcn.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <semaphore.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

namespace {

using locus::test::SimulatedTime;

constexpr std::int64_t kSecond = 1'000'000'000;

template <class Function> Function* next(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

std::int64_t ns_of(const timespec& time) { return time.tv_sec * kSecond + time.tv_nsec; }

timespec to_timespec(std::int64_t ns) {
  const std::int64_t seconds = ns / kSecond - (ns % kSecond < 0 ? 1 : 0);
  return {seconds, ns - seconds * kSecond};
}

std::int64_t system_ns(clockid_t clock) {
  static auto* const kNext = next<int(clockid_t, timespec*)>("clock_gettime");
  timespec time{};
  kNext(clock, &time);
  return ns_of(time);
}

constexpr SimulatedTime kSystemTime;
const volatile SimulatedTime* simulated = &kSystemTime; ///< before begin(): a sanitizer reads the clock while it starts

__attribute__((constructor)) void begin() {
  prctl(PR_SET_TIMERSLACK, 1); // as for real-time threads: the kernel's 50 us would be scaled by the rate
  const int file = open(std::getenv("SIMULATED_CLOCK"), O_RDONLY | O_CLOEXEC); // NOLINT(concurrency-mt-unsafe)
  void* const page = mmap(nullptr, sizeof(SimulatedTime), PROT_READ, MAP_SHARED, file, 0);
  close(file);
  if (page != MAP_FAILED)
    simulated = static_cast<const volatile SimulatedTime*>(page);
}

bool is_faster() { return simulated->rate > 0; }

/// Converts a simulated duration to system time, rounded up.
std::int64_t shortened(std::int64_t ns) {
  return is_faster() ? static_cast<std::int64_t>(std::ceil(static_cast<double>(ns) / simulated->rate)) : ns;
}

std::int64_t from_origin(std::int64_t monotonic_ns) {
  const auto since = static_cast<double>(monotonic_ns - simulated->origin_ns);
  return simulated->origin_ns + static_cast<std::int64_t>(since * simulated->rate);
}

/// Returns the system's CLOCK_REALTIME - CLOCK_MONOTONIC, from reads without a preemption between them if possible.
std::int64_t system_wall_ahead_ns() {
  constexpr std::int64_t kUndisturbed = 1'000;
  std::int64_t ahead = 0;
  for (int i = 0; i < 20; ++i) {
    const std::int64_t before = system_ns(CLOCK_MONOTONIC), wall = system_ns(CLOCK_REALTIME);
    ahead = wall - before;
    if (system_ns(CLOCK_MONOTONIC) - before < kUndisturbed)
      break;
  }
  return ahead;
}

/// Converts a kernel stamp of the wall clock.
timespec simulated_stamp(const timespec& stamp, std::int64_t wall_ahead_ns) {
  if (!is_faster())
    return to_timespec(ns_of(stamp) + simulated->set_by_ns);
  const std::int64_t monotonic = from_origin(ns_of(stamp) - wall_ahead_ns);
  return to_timespec(monotonic + simulated->wall_minus_origin_ns + simulated->set_by_ns);
}

void simulate_stamps(mmsghdr* messages, int count) {
  const std::int64_t wall_ahead = count > 0 && is_faster() ? system_wall_ahead_ns() : 0;
  for (int i = 0; i < count; ++i)
    for (cmsghdr* c = CMSG_FIRSTHDR(&messages[i].msg_hdr); c != nullptr; c = CMSG_NXTHDR(&messages[i].msg_hdr, c))
      if (c->cmsg_level == SOL_SOCKET && c->cmsg_type == SCM_TIMESTAMPNS) {
        timespec stamp{};
        std::memcpy(&stamp, CMSG_DATA(c), sizeof(stamp));
        stamp = simulated_stamp(stamp, wall_ahead);
        std::memcpy(CMSG_DATA(c), &stamp, sizeof(stamp));
      }
}

/// Waits until a time of `clock`; in slices for the wall clock, because it may be stepped meanwhile. `wait` waits until
/// a system CLOCK_MONOTONIC time; its result ends the wait unless `goes_on` holds for it.
int wait_until(clockid_t clock, const timespec& until, const auto& wait, const auto& goes_on) {
  constexpr std::int64_t kSlice = 5'000'000;
  while (true) {
    timespec now{};
    clock_gettime(clock, &now);
    const std::int64_t left = std::max<std::int64_t>(shortened(ns_of(until) - ns_of(now)), 0);
    const std::int64_t slice = clock == CLOCK_REALTIME ? std::min(left, kSlice) : left;
    const timespec end = to_timespec(system_ns(CLOCK_MONOTONIC) + slice);
    const int result = wait(end);
    if (!goes_on(result) || left == slice)
      return result;
  }
}

} // namespace

extern "C" {

int clock_gettime(clockid_t clock, timespec* time) noexcept {
  static auto* const kNext = next<int(clockid_t, timespec*)>("clock_gettime");
  const bool is_wall = clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE;
  const bool is_monotonic = clock == CLOCK_MONOTONIC || clock == CLOCK_MONOTONIC_COARSE || clock == CLOCK_MONOTONIC_RAW;
  if (!is_faster() || (!is_wall && !is_monotonic && clock != CLOCK_BOOTTIME)) {
    const int result = kNext(clock, time);
    if (result == 0 && is_wall)
      *time = to_timespec(ns_of(*time) + simulated->set_by_ns);
    return result;
  }
  const std::int64_t monotonic = from_origin(system_ns(CLOCK_MONOTONIC));
  *time = to_timespec(monotonic + (is_wall        ? simulated->wall_minus_origin_ns + simulated->set_by_ns
                                   : is_monotonic ? 0
                                                  : simulated->boot_minus_origin_ns));
  return 0;
}

int gettimeofday(timeval* time, void* /*zone*/) noexcept {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  *time = {now.tv_sec, now.tv_nsec / 1000};
  return 0;
}

time_t time(time_t* seconds) noexcept {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  if (seconds != nullptr)
    *seconds = now.tv_sec;
  return now.tv_sec;
}

int recvmmsg(int socket, mmsghdr* messages, unsigned count, int flags, timespec* timeout) {
  static auto* const kNext = next<int(int, mmsghdr*, unsigned, int, timespec*)>("recvmmsg");
  const int received = kNext(socket, messages, count, flags, timeout);
  simulate_stamps(messages, received);
  return received;
}

int setsockopt(int socket, int level, int option, const void* value, socklen_t size) noexcept {
  static auto* const kNext = next<int(int, int, int, const void*, socklen_t)>("setsockopt");
  if (level != SOL_SOCKET || (option != SO_RCVTIMEO && option != SO_SNDTIMEO) || size != sizeof(timeval))
    return kNext(socket, level, option, value, size);
  timeval timeout{};
  std::memcpy(&timeout, value, sizeof(timeout));
  const timespec shorter = to_timespec(shortened(timeout.tv_sec * kSecond + timeout.tv_usec * 1000));
  timeout = {shorter.tv_sec, (shorter.tv_nsec + 999) / 1000};
  return kNext(socket, level, option, &timeout, sizeof(timeout));
}

int ppoll(pollfd* descriptors, nfds_t count, const timespec* timeout, const sigset_t* signals) {
  static auto* const kNext = next<int(pollfd*, nfds_t, const timespec*, const sigset_t*)>("ppoll");
  if (timeout == nullptr)
    return kNext(descriptors, count, timeout, signals);
  const timespec shorter = to_timespec(shortened(ns_of(*timeout)));
  return kNext(descriptors, count, &shorter, signals);
}

int poll(pollfd* descriptors, nfds_t count, int timeout_ms) {
  const timespec timeout = to_timespec(std::int64_t{1'000'000} * timeout_ms);
  return ppoll(descriptors, count, timeout_ms < 0 ? nullptr : &timeout, nullptr);
}

int select(int count, fd_set* read, fd_set* write, fd_set* except, timeval* timeout) {
  static auto* const kNext = next<int(int, fd_set*, fd_set*, fd_set*, timeval*)>("select");
  if (timeout == nullptr)
    return kNext(count, read, write, except, timeout);
  const timespec shorter = to_timespec(shortened(timeout->tv_sec * kSecond + timeout->tv_usec * 1000));
  timeval shorter_us{shorter.tv_sec, (shorter.tv_nsec + 999) / 1000};
  return kNext(count, read, write, except, &shorter_us);
}

/// `left` after a signal is in system time; no caller reads it.
int nanosleep(const timespec* duration, timespec* left) {
  static auto* const kNext = next<int(const timespec*, timespec*)>("nanosleep");
  const timespec shorter = to_timespec(shortened(ns_of(*duration)));
  return kNext(&shorter, left);
}

int clock_nanosleep(clockid_t clock, int flags, const timespec* time, timespec* left) {
  static auto* const kNext = next<int(clockid_t, int, const timespec*, timespec*)>("clock_nanosleep");
  if ((flags & TIMER_ABSTIME) == 0) {
    const timespec shorter = to_timespec(shortened(ns_of(*time)));
    return kNext(CLOCK_MONOTONIC, flags, &shorter, left);
  }
  return wait_until(
      clock, *time, [&](const timespec& end) { return kNext(CLOCK_MONOTONIC, flags, &end, nullptr); },
      [](int result) { return result == 0; });
}

int pthread_cond_clockwait(pthread_cond_t* condition, pthread_mutex_t* mutex, clockid_t clock, const timespec* until) {
  static auto* const kNext =
      next<int(pthread_cond_t*, pthread_mutex_t*, clockid_t, const timespec*)>("pthread_cond_clockwait");
  return wait_until(
      clock, *until, [&](const timespec& end) { return kNext(condition, mutex, CLOCK_MONOTONIC, &end); },
      [](int result) { return result == ETIMEDOUT; });
}

int pthread_cond_timedwait(pthread_cond_t* condition, pthread_mutex_t* mutex, const timespec* until) {
  return pthread_cond_clockwait(condition, mutex, CLOCK_REALTIME, until);
}

int sem_clockwait(sem_t* semaphore, clockid_t clock, const timespec* until) {
  static auto* const kNext = next<int(sem_t*, clockid_t, const timespec*)>("sem_clockwait");
  return wait_until(
      clock, *until, [&](const timespec& end) { return kNext(semaphore, CLOCK_MONOTONIC, &end); },
      [](int result) { return result != 0 && errno == ETIMEDOUT; });
}

} // extern "C"

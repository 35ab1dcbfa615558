// SPDX-License-Identifier: Apache-2.0
// LD_PRELOAD library for the service and for the player that controls its time (LEADS_CLOCK in its environment); both
// share the file LED_CLOCK (led_clock.hpp). Time stands still from the player's first read of the wall clock until it
// exits. Each sleep of the player returns at once and advances the time by its length, after the service has processed
// everything sent before. Datagrams and samples thus arrive at their recorded times by the service's clock, however
// busy the computer is. Real waits such as timeouts take real time. Cyclone DDS uses the system's clocks, except for
// the wall clock: its own functions of time are replaced, since calls of those of the C library reach this one from the
// interceptors of a sanitizer, which hide the caller.
#include "support/led_clock.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cinttypes>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <string_view>

#include <dlfcn.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <semaphore.h>
#include <sys/eventfd.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

namespace {

using locus::test::LedTime;

constexpr std::int64_t kSecond = 1'000'000'000;

template <class Function> Function* next(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

std::int64_t ns_of(const timespec& time) { return time.tv_sec * kSecond + time.tv_nsec; }
timespec to_timespec(std::int64_t ns) { return {ns / kSecond, ns % kSecond}; }

std::int64_t system_ns(clockid_t clock) {
  static auto* const kNext = next<int(clockid_t, timespec*)>("clock_gettime");
  timespec time{};
  kNext(clock, &time);
  return ns_of(time);
}

// Ingest thread of the service; counts go on where those of a process before it ended.
std::uint64_t received_datagrams = 0;
std::atomic<std::uint64_t> pushed_motion{0}; ///< any thread
std::uint64_t seen_motion = 0;               ///< pushed before the last wait ended

bool leads = false;
LedTime nobodys_time;
LedTime* led = &nobodys_time;

__attribute__((constructor)) void begin() {
  const char* const name = std::getenv("LED_CLOCK"); // NOLINT(concurrency-mt-unsafe)
  const int file = name != nullptr ? open(name, O_RDWR | O_CLOEXEC) : -1;
  if (file < 0)
    return;
  void* const page = mmap(nullptr, sizeof(LedTime), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  close(file);
  if (page == MAP_FAILED)
    return;
  led = static_cast<LedTime*>(page);
  leads = std::getenv("LEADS_CLOCK") != nullptr; // NOLINT(concurrency-mt-unsafe)
  received_datagrams = led->datagrams.load();
  seen_motion = led->motion.load();
  pushed_motion = seen_motion;
}

bool is_wall(clockid_t clock) { return clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE; }
bool is_monotonic(clockid_t clock) {
  return clock == CLOCK_MONOTONIC || clock == CLOCK_MONOTONIC_COARSE || clock == CLOCK_MONOTONIC_RAW;
}

std::int64_t led_ns(clockid_t clock) {
  const std::int64_t set_by_ns = is_wall(clock) && !leads ? led->set_by_ns.load(std::memory_order_relaxed) : 0;
  if (led->is_led.load(std::memory_order_acquire) == 0)
    return system_ns(clock) + led->offset_ns.load(std::memory_order_relaxed) + set_by_ns;
  const std::int64_t began = is_wall(clock) ? led->wall_ns : is_monotonic(clock) ? led->monotonic_ns : led->boot_ns;
  return began + led->added_ns.load(std::memory_order_relaxed) + set_by_ns;
}

// Player side.

std::uint64_t sent_datagrams = 0, sent_motion = 0; ///< includes those that the service had received before

void take_over() {
  led->wall_ns = led_ns(CLOCK_REALTIME);
  led->monotonic_ns = led_ns(CLOCK_MONOTONIC);
  led->boot_ns = led_ns(CLOCK_BOOTTIME);
  sent_datagrams = led->datagrams.load();
  sent_motion = led->motion.load();
  led->added_ns.store(0);
  led->is_led.store(1, std::memory_order_release);
}

/// Waits until the service has processed everything sent; ends the player if it does not in two minutes.
void wait_for_the_service() {
  static auto* const kSleep = next<int(const timespec*, timespec*)>("nanosleep");
  constexpr timespec kLook{0, 20'000};
  const std::int64_t give_up_ns = system_ns(CLOCK_MONOTONIC) + 120 * kSecond;
  while (led->datagrams.load(std::memory_order_acquire) < sent_datagrams ||
         led->motion.load(std::memory_order_acquire) < sent_motion) {
    if (system_ns(CLOCK_MONOTONIC) > give_up_ns) {
      std::fprintf(stderr,
                   "led_clock: the service has processed %" PRIu64 " of %" PRIu64 " datagrams and %" PRIu64
                   " of %" PRIu64 " motion samples\n",
                   led->datagrams.load(), sent_datagrams, led->motion.load(), sent_motion);
      _exit(EXIT_FAILURE);
    }
    kSleep(&kLook, nullptr);
  }
}

/// Waits while the test holds the time.
void wait_for_the_test() {
  static auto* const kSleep = next<int(const timespec*, timespec*)>("nanosleep");
  constexpr timespec kLook{0, 1'000'000};
  for (std::int64_t at = led->hold_at_ns.load(); at != 0 && led->added_ns.load() >= at; at = led->hold_at_ns.load()) {
    led->held_at_ns.store(at);
    kSleep(&kLook, nullptr);
    sent_datagrams = led->datagrams.load(); // others may have sent meanwhile
    sent_motion = led->motion.load();
  }
}

/// Lets time run on its own from here.
__attribute__((destructor)) void end() {
  if (!leads || led->is_led.load() == 0)
    return;
  wait_for_the_service();
  led->offset_ns.store(led_ns(CLOCK_MONOTONIC) - system_ns(CLOCK_MONOTONIC));
  led->is_led.store(0, std::memory_order_release);
}

bool is_ingest() {
  thread_local bool is = false;
  std::array<char, 16> name{};
  if (!is && pthread_getname_np(pthread_self(), name.data(), name.size()) == 0)
    is = std::string_view(name.data()) == "ingest";
  return is;
}

} // namespace

extern "C" {

int clock_gettime(clockid_t clock, timespec* time) noexcept {
  if (leads && is_wall(clock) && led->is_led.load() == 0)
    take_over();
  const bool is_led = is_wall(clock) || is_monotonic(clock) || clock == CLOCK_BOOTTIME;
  *time = to_timespec(is_led ? led_ns(clock) : system_ns(clock));
  return 0;
}

/// Intercepts the player's sleeps, and the service's pause after requests, 50 ms in which no time passes: the player
/// makes a request for each 40 ms of its time.
int nanosleep(const timespec* duration, timespec* left) {
  static auto* const kNext = next<int(const timespec*, timespec*)>("nanosleep");
  constexpr timespec kPause{0, 500'000};
  if (led->is_led.load() == 0)
    return kNext(duration, left);
  if (!leads)
    return kNext(gettid() == getpid() ? &kPause : duration, left);
  wait_for_the_service();
  led->added_ns.fetch_add(ns_of(*duration));
  wait_for_the_test();
  return 0;
}

ssize_t sendto(int socket, const void* bytes, size_t size, int flags, const sockaddr* to, socklen_t to_size) {
  static auto* const kNext = next<ssize_t(int, const void*, size_t, int, const sockaddr*, socklen_t)>("sendto");
  const ssize_t sent = kNext(socket, bytes, size, flags, to, to_size);
  sent_datagrams += leads && sent >= 0 ? 1U : 0U;
  return sent;
}

// Cyclone DDS, whose functions of time have a structure of one integer as their result.

std::int64_t dds_time() { return led_ns(CLOCK_REALTIME); }
std::int64_t ddsrt_time_wallclock() { return led_ns(CLOCK_REALTIME); }
std::int64_t ddsrt_time_monotonic() { return system_ns(CLOCK_MONOTONIC); }
std::int64_t ddsrt_time_elapsed() { return system_ns(CLOCK_MONOTONIC); }

void dds_sleepfor(std::int64_t ns) {
  static auto* const kSleep = next<int(const timespec*, timespec*)>("nanosleep");
  timespec left = to_timespec(ns);
  while (kSleep(&left, &left) != 0 && errno == EINTR) {
  }
}

/// Waits until a wall-clock time; false if it has come. Calls by name, which a sanitizer that follows locks observes.
bool ddsrt_cond_waituntil(pthread_cond_t* condition, pthread_mutex_t* mutex, std::int64_t until_ns) {
  constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::max();
  if (until_ns == kNever)
    return pthread_cond_wait(condition, mutex) == 0;
  const timespec until = to_timespec(until_ns);
  return pthread_cond_clockwait(condition, mutex, CLOCK_REALTIME, &until) != ETIMEDOUT;
}

/// Intercepts the histories: since the time of the service does not wait for its subscribers, what they have not yet
/// acknowledged stays, but for topics of which the latest alone matters.
void dds_qset_history(void* qos, int kind, std::int32_t depth) {
  static auto* const kNext = next<void(void*, int, std::int32_t)>("dds_qset_history");
  constexpr std::int32_t kFew = 5, kAll = 10'000;
  kNext(qos, kind, depth > kFew ? kAll : depth);
}

/// Counts the player's samples.
std::int32_t dds_write(std::int32_t writer, const void* data) {
  static auto* const kNext = next<std::int32_t(std::int32_t, const void*)>("dds_write");
  const std::int32_t result = kNext(writer, data);
  sent_motion += leads && result == 0 ? 1U : 0U;
  return result;
}

/// Intercepts the end of the player's writers: a subscriber whose threads receive the samples last, after the end of
/// their writer, drops them.
std::int32_t dds_delete(std::int32_t entity) {
  static auto* const kNext = next<std::int32_t(std::int32_t)>("dds_delete");
  if (leads && led->is_led.load() != 0)
    wait_for_the_service();
  return kNext(entity);
}

int recvmmsg(int socket, mmsghdr* messages, unsigned count, int flags, timespec* timeout) {
  static auto* const kNext = next<int(int, mmsghdr*, unsigned, int, timespec*)>("recvmmsg");
  const int received = kNext(socket, messages, count, flags, timeout);
  received_datagrams += static_cast<std::uint64_t>(std::max(received, 0));
  const bool is_led = led->is_led.load(std::memory_order_acquire) != 0;
  for (int i = 0; i < received; ++i)
    for (cmsghdr* c = CMSG_FIRSTHDR(&messages[i].msg_hdr); c != nullptr; c = CMSG_NXTHDR(&messages[i].msg_hdr, c))
      if (c->cmsg_level == SOL_SOCKET && c->cmsg_type == SCM_TIMESTAMPNS) {
        timespec stamp{};
        std::memcpy(&stamp, CMSG_DATA(c), sizeof(stamp));
        stamp =
            to_timespec(is_led ? led_ns(CLOCK_REALTIME) : ns_of(stamp) + led->offset_ns.load() + led->set_by_ns.load());
        std::memcpy(CMSG_DATA(c), &stamp, sizeof(stamp));
      }
  return received;
}

int eventfd_write(int descriptor, eventfd_t value) {
  static auto* const kNext = next<int(int, eventfd_t)>("eventfd_write");
  ++pushed_motion;
  return kNext(descriptor, value);
}

/// Intercepts the ingest thread's wait, which begins only after everything that it found before is processed.
int ppoll(pollfd* descriptors, nfds_t count, const timespec* timeout, const sigset_t* signals) {
  static auto* const kNext = next<int(pollfd*, nfds_t, const timespec*, const sigset_t*)>("ppoll");
  if (!is_ingest())
    return kNext(descriptors, count, timeout, signals);
  if (timeout == nullptr || ns_of(*timeout) > 0) {
    led->datagrams.store(received_datagrams, std::memory_order_release);
    led->motion.store(seen_motion, std::memory_order_release);
  }
  const int result = kNext(descriptors, count, timeout, signals);
  seen_motion = pushed_motion.load();
  return result;
}

int sem_clockwait(sem_t* semaphore, clockid_t clock, const timespec* until) {
  static auto* const kNext = next<int(sem_t*, clockid_t, const timespec*)>("sem_clockwait");
  const timespec end = to_timespec(system_ns(CLOCK_MONOTONIC) + ns_of(*until) - led_ns(clock));
  return kNext(semaphore, CLOCK_MONOTONIC, &end);
}

int pthread_cond_clockwait(pthread_cond_t* condition, pthread_mutex_t* mutex, clockid_t clock, const timespec* until) {
  static auto* const kNext =
      next<int(pthread_cond_t*, pthread_mutex_t*, clockid_t, const timespec*)>("pthread_cond_clockwait");
  const timespec end = to_timespec(system_ns(CLOCK_MONOTONIC) + ns_of(*until) - led_ns(clock));
  return kNext(condition, mutex, CLOCK_MONOTONIC, &end);
}

} // extern "C"

// SPDX-License-Identifier: Apache-2.0
// LD_PRELOAD library: about one in RANDOM_DELAYS calls at which a thread may lose its processor, and one in eight new
// threads, waits for 0.1 to 300 ms, half of them for less than 6 ms. Brings about in minutes what a busy computer does
// in days; see with_random_delays.sh. Without RANDOM_DELAYS in the environment it does nothing.
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <new>

#include <dlfcn.h>
#include <poll.h>
#include <pthread.h>
#include <semaphore.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

namespace {

constexpr std::uint64_t kShareOfThreads = 8;

std::uint64_t calls_per_delay() {
  static const std::uint64_t calls = [] {
    const char* text = std::getenv("RANDOM_DELAYS"); // NOLINT(concurrency-mt-unsafe): nobody sets it
    return text != nullptr ? std::strtoull(text, nullptr, 10) : 0;
  }();
  return calls;
}

/// Returns a pseudo-random number (xorshift), seeded by the thread and the time. Uses system calls, since other
/// preloaded libraries replace the clocks.
std::uint64_t random_number() {
  thread_local std::uint64_t state = [] {
    timespec now{};
    syscall(SYS_clock_gettime, CLOCK_MONOTONIC, &now);
    const auto thread = static_cast<std::uint64_t>(syscall(SYS_gettid));
    return (thread << 32U | 1U) ^ (static_cast<std::uint64_t>(now.tv_nsec) << 1U);
  }();
  state ^= state << 13U;
  state ^= state >> 7U;
  state ^= state << 17U;
  return state;
}

void wait_sometimes(std::uint64_t calls) {
  if (calls == 0 || random_number() % calls != 0)
    return;
  const double exponent = static_cast<double>(random_number() % 1000) / 1000.0;
  const timespec time{0, static_cast<long>(1e5 * std::pow(3000.0, exponent))};
  const int error = errno;
  syscall(SYS_nanosleep, &time, nullptr);
  errno = error;
}

template <class Function> Function* next(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

struct Thread {
  void* (*run)(void*);
  void* argument;
};

void* run_later(void* given) {
  const Thread thread = *std::unique_ptr<Thread>(static_cast<Thread*>(given));
  wait_sometimes(kShareOfThreads);
  return thread.run(thread.argument);
}

} // namespace

// NOLINTNEXTLINE(cppcoreguidelines-macro-usage): defines functions of C
#define DELAYED(Result, name, parameters, arguments)                                                                   \
  Result name parameters {                                                                                             \
    static auto* const kNext = next<Result parameters>(#name);                                                         \
    wait_sometimes(calls_per_delay());                                                                                 \
    const Result result = kNext arguments;                                                                             \
    wait_sometimes(calls_per_delay());                                                                                 \
    return result;                                                                                                     \
  }

extern "C" {

DELAYED(ssize_t, recv, (int socket, void* bytes, size_t size, int flags), (socket, bytes, size, flags))
DELAYED(ssize_t, recvmsg, (int socket, msghdr* message, int flags), (socket, message, flags))
DELAYED(int, recvmmsg, (int socket, mmsghdr* messages, unsigned count, int flags, timespec* timeout),
        (socket, messages, count, flags, timeout))
DELAYED(ssize_t, sendmsg, (int socket, const msghdr* message, int flags), (socket, message, flags))
DELAYED(ssize_t, sendto, (int socket, const void* bytes, size_t size, int flags, const sockaddr* to, socklen_t to_size),
        (socket, bytes, size, flags, to, to_size))
DELAYED(int, connect, (int socket, const sockaddr* to, socklen_t size), (socket, to, size))
DELAYED(int, accept4, (int socket, sockaddr* from, socklen_t* size, int flags), (socket, from, size, flags))
DELAYED(int, poll, (pollfd * descriptors, nfds_t count, int timeout), (descriptors, count, timeout))
DELAYED(int, ppoll, (pollfd * descriptors, nfds_t count, const timespec* timeout, const sigset_t* signals),
        (descriptors, count, timeout, signals))
DELAYED(ssize_t, read, (int descriptor, void* bytes, size_t size), (descriptor, bytes, size))
DELAYED(ssize_t, write, (int descriptor, const void* bytes, size_t size), (descriptor, bytes, size))
DELAYED(int, fsync, (int descriptor), (descriptor))
DELAYED(int, sem_wait, (sem_t * semaphore), (semaphore))
DELAYED(int, sem_post, (sem_t * semaphore), (semaphore))
DELAYED(int, sem_clockwait, (sem_t * semaphore, clockid_t clock, const timespec* until), (semaphore, clock, until))
DELAYED(int, pthread_cond_clockwait,
        (pthread_cond_t * condition, pthread_mutex_t* mutex, clockid_t clock, const timespec* until),
        (condition, mutex, clock, until))

int pthread_create(pthread_t* thread, const pthread_attr_t* attributes, void* (*run)(void*), void* argument) {
  static auto* const kNext = next<int(pthread_t*, const pthread_attr_t*, void* (*)(void*), void*)>("pthread_create");
  if (calls_per_delay() == 0)
    return kNext(thread, attributes, run, argument);
  auto* const later = new (std::nothrow) Thread{run, argument}; // freed by run_later()
  return later != nullptr ? kNext(thread, attributes, run_later, later) : EAGAIN;
}

} // extern "C"

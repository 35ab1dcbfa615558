// SPDX-License-Identifier: Apache-2.0
// To be preloaded: the wall clock of a program, as the file STEPPED_CLOCK has it, which holds by how many nanoseconds
// it is off. All that a program can see of it is off by as much: the time, the stamps of datagrams, and waits until a
// time of that clock, which in the kernel follow a clock that is set, too.
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>

#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

std::int64_t offset_ns() {
  static const volatile std::int64_t* const kOffset = [] {
    const int file = open(std::getenv("STEPPED_CLOCK"), O_RDONLY | O_CLOEXEC); // NOLINT(concurrency-mt-unsafe)
    void* const page = mmap(nullptr, sizeof(std::int64_t), PROT_READ, MAP_SHARED, file, 0);
    close(file);
    return page == MAP_FAILED ? nullptr : static_cast<const volatile std::int64_t*>(page);
  }();
  return kOffset == nullptr ? 0 : *kOffset;
}

void step(timespec& time) {
  const std::int64_t ns = time.tv_sec * kSecond + time.tv_nsec + offset_ns();
  time = {ns / kSecond, ns % kSecond};
}

template <class Function> Function* next(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

void step_stamps(mmsghdr* messages, int count) {
  for (int i = 0; i < count; ++i)
    for (cmsghdr* c = CMSG_FIRSTHDR(&messages[i].msg_hdr); c != nullptr; c = CMSG_NXTHDR(&messages[i].msg_hdr, c))
      if (c->cmsg_level == SOL_SOCKET && c->cmsg_type == SCM_TIMESTAMPNS) {
        timespec stamp{};
        std::memcpy(&stamp, CMSG_DATA(c), sizeof(stamp));
        step(stamp);
        std::memcpy(CMSG_DATA(c), &stamp, sizeof(stamp));
      }
}

} // namespace

extern "C" {

int clock_gettime(clockid_t clock, timespec* time) noexcept {
  static auto* const kNext = next<int(clockid_t, timespec*)>("clock_gettime");
  const int result = kNext(clock, time);
  if (result == 0 && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE))
    step(*time);
  return result;
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
  step_stamps(messages, received);
  return received;
}

/// In slices, for the clock may be set meanwhile.
int pthread_cond_timedwait(pthread_cond_t* condition, pthread_mutex_t* mutex, const timespec* until) {
  constexpr std::int64_t kSlice = 5'000'000;
  while (true) {
    timespec now{}, slice{};
    clock_gettime(CLOCK_REALTIME, &now);
    const std::int64_t left = (until->tv_sec - now.tv_sec) * kSecond + until->tv_nsec - now.tv_nsec;
    clock_gettime(CLOCK_MONOTONIC, &slice);
    slice.tv_nsec += left < 0 ? 0 : left < kSlice ? left : kSlice;
    slice = {slice.tv_sec + slice.tv_nsec / kSecond, slice.tv_nsec % kSecond};
    const int result = pthread_cond_clockwait(condition, mutex, CLOCK_MONOTONIC, &slice);
    if (result != ETIMEDOUT || left <= kSlice)
      return result;
  }
}

} // extern "C"

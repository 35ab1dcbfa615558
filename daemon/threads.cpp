// SPDX-License-Identifier: Apache-2.0
#include "daemon/threads.hpp"

#include <cerrno>
#include <ctime>
#include <utility>

#include <pthread.h>

#include "daemon/machine_time.hpp"

namespace locus::daemon {

Wakeup::Wakeup() { sem_init(&semaphore_, 0, 0); }

Wakeup::~Wakeup() { sem_destroy(&semaphore_); }

void Wakeup::notify() noexcept { sem_post(&semaphore_); }

void Wakeup::wait_for(Duration timeout) noexcept {
  const timespec deadline = to_timespec(read_clock(CLOCK_MONOTONIC) + timeout);
  while (sem_clockwait(&semaphore_, CLOCK_MONOTONIC, &deadline) != 0 && errno == EINTR) {
  }
  while (sem_trywait(&semaphore_) == 0) { // one check covers all notifications
  }
}

Worker::Worker(const char* name, Duration period, Round round, std::function<void()> begin)
    : thread_([this, period, round = std::move(round), begin = std::move(begin)] {
        if (begin)
          begin();
        while (!stopping_.load(std::memory_order_relaxed)) {
          wakeup_.wait_for(period);
          round(false);
        }
        round(true);
      }) {
  pthread_setname_np(thread_.native_handle(), name);
}

Worker::~Worker() {
  stopping_.store(true, std::memory_order_relaxed);
  wakeup_.notify();
  thread_.join();
}

} // namespace locus::daemon

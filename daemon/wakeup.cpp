// SPDX-License-Identifier: Apache-2.0
#include "daemon/wakeup.hpp"

#include <cerrno>
#include <ctime>

#include "daemon/machine_time.hpp"

namespace locus::daemon {

Wakeup::Wakeup() { sem_init(&semaphore_, 0, 0); }

Wakeup::~Wakeup() { sem_destroy(&semaphore_); }

void Wakeup::notify() noexcept { sem_post(&semaphore_); }

void Wakeup::wait_for(Duration timeout) noexcept {
  const timespec deadline = to_timespec(read_clock(CLOCK_MONOTONIC) + timeout);
  while (sem_clockwait(&semaphore_, CLOCK_MONOTONIC, &deadline) != 0 && errno == EINTR) {
  }
}

} // namespace locus::daemon

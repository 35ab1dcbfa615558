// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <semaphore.h>

#include "core/base/stamp.hpp"

namespace locus::daemon {

/// Lets a consumer sleep until a lock-free queue beside it has something, and not a moment longer than a timeout.
///
/// The semaphore of the C library: notify() is one atomic addition and, if somebody sleeps, one futex call. That of the
/// standard library will not do: its timed wait in libstdc++ polls with pauses that grow to 64 ms. A notification is a
/// hint to look again; one that comes before the wait is not lost. Any thread may notify, one waits.
class Wakeup {
 public:
  Wakeup();
  ~Wakeup();
  Wakeup(const Wakeup&) = delete;
  Wakeup& operator=(const Wakeup&) = delete;

  void notify() noexcept;

  /// Returns after a notification that no earlier wait has used, or after `timeout`.
  void wait_for(Duration timeout) noexcept;

 private:
  sem_t semaphore_{};
};

} // namespace locus::daemon

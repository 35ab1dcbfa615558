// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <thread>

#include "core/base/stamp.hpp"
#include "daemon/wakeup.hpp"

namespace locus::daemon {

/// A thread that looks into a queue beside it, such as a LatestSlot or an SpscRing, whenever its producer notifies it.
///
/// It does a round after each notification, every `period` at the latest, and a last one when it is destroyed, which
/// waits for it. One owner; any thread may notify.
class Worker {
 public:
  /// `name` is what top -H shows, 15 characters at most; `begin` is done once, in the thread.
  Worker(const char* name, Duration period, std::function<void()> round, std::function<void()> begin = {});
  ~Worker();
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  void notify() noexcept { wakeup_.notify(); }

  /// In a round: whether its owner waits for it to end.
  [[nodiscard]] bool stopping() const { return stopping_.load(std::memory_order_relaxed); }

 private:
  Wakeup wakeup_;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

} // namespace locus::daemon

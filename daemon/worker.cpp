// SPDX-License-Identifier: Apache-2.0
#include "daemon/worker.hpp"

#include <utility>

#include <pthread.h>

namespace locus::daemon {

Worker::Worker(const char* name, Duration period, std::function<void()> round, std::function<void()> begin)
    : thread_([this, period, round = std::move(round), begin = std::move(begin)] {
        if (begin)
          begin();
        while (!stopping()) {
          wakeup_.wait_for(period);
          round();
        }
        round();
      }) {
  pthread_setname_np(thread_.native_handle(), name);
}

Worker::~Worker() {
  stopping_.store(true, std::memory_order_relaxed);
  wakeup_.notify();
  thread_.join();
}

} // namespace locus::daemon

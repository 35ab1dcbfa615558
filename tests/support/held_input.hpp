// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <thread>

#include "daemon/input.hpp"
#include "daemon/live_pipeline.hpp"

namespace locus::test {

/// Decorator of an input that waits for the pipeline now and then.
class HeldInput : public daemon::InputSource {
 public:
  /// `input` must outlive this.
  explicit HeldInput(daemon::InputSource& input) : input_(input) {}

  daemon::Input next(Duration timeout) override {
    if (waits()) {
      std::this_thread::sleep_for(std::min<Duration>(timeout, std::chrono::microseconds{100}));
      return daemon::Silence{last_arrival_};
    }
    daemon::Input input = input_.next(timeout);
    last_arrival_ = daemon::arrival_of(input, last_arrival_);
    return input;
  }

 protected:
  virtual bool waits() = 0;

  std::atomic<const daemon::LivePipeline*> pipeline_{nullptr}; ///< the input waits until there is one

 private:
  daemon::InputSource& input_;
  Stamp last_arrival_;
};

/// Feeds the input no faster than the odometry processes it, so that nothing is dropped.
class PatientInput : public HeldInput {
 public:
  using HeldInput::HeldInput;

  /// nullptr: wait until the next pipeline is set.
  void wait_for(const daemon::LivePipeline* pipeline) { pipeline_.store(pipeline); }

 private:
  bool waits() override {
    const daemon::LivePipeline* pipeline = pipeline_.load();
    if (pipeline == nullptr)
      return true;
    const daemon::SweepCounters counters = pipeline->counters();
    return counters.seen > counters.processed + counters.failed + counters.dropped;
  }
};

} // namespace locus::test

// SPDX-License-Identifier: Apache-2.0
// stage_instructions STAGE...: drives through the plant with lidar alone, once for each stage, and counts by callgrind
// the instructions of that stage, or of the whole pipeline (`all`); each count is a dump of callgrind's.
// stage_instructions.sh runs it and compares.
#include <valgrind/callgrind.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <string_view>
#include <vector>

#include "core/odometry/odometry.hpp"
#include "core/recording.hpp"

namespace {

using namespace locus;

/// Counts while the selected stage is the innermost one.
class InstructionCounter : public StageClock {
 public:
  explicit InstructionCounter(std::string_view wanted) : wanted_(wanted), outside_(wanted == "all") {}

  void enter(Stage stage) override {
    counts_.push_back(outside_ || to_string(stage) == wanted_);
    count(counts_.back());
  }
  void leave() override {
    counts_.pop_back();
    count(counts_.empty() ? outside_ : counts_.back());
  }

  /// Starts counting, after the initialisation in the first sweeps.
  void start() {
    CALLGRIND_START_INSTRUMENTATION;
    started_ = true;
    count(outside_);
  }
  void stop() {
    count(false);
    CALLGRIND_STOP_INSTRUMENTATION;
    started_ = false;
  }

 private:
  void count(bool on) {
    if (started_ && on != counting_)
      CALLGRIND_TOGGLE_COLLECT;
    counting_ = started_ && on;
  }

  std::string_view wanted_;
  bool outside_;
  std::vector<bool> counts_; ///< of the open stages
  bool started_ = false, counting_ = false;
};

/// Counts the instructions of a stage; returns the number of sweeps.
int count(const test::Recording& recording, const char* stage) {
  constexpr int kWarmUp = 30; // standstill and acceleration
  InstructionCounter counter(stage);
  SweepOptions sweep_options;
  OdometryOptions options;
  sweep_options.isa = options.isa = Isa::baseline;
  options.threads = 1;
  options.map.keyframe_m = 0.25; // so that the short drive contains several
  test::SweepsOfRecording sweeps(recording, sweep_options, &counter);
  Odometry odometry(options, {}, &counter);
  int sweeps_seen = 0;
  while (const Sweep* sweep = sweeps.next()) {
    odometry.process(*sweep);
    if (++sweeps_seen == kWarmUp)
      counter.start();
  }
  counter.stop();
  CALLGRIND_DUMP_STATS_AT(stage);
  return sweeps_seen - kWarmUp;
}

} // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fputs("usage: stage_instructions STAGE...\n", stderr);
    return 2;
  }
  const test::Recording recording = test::plant_recording(std::chrono::milliseconds{4450});
  for (int i = 1; i < argc; ++i)
    std::printf("%s %d\n", argv[i], count(recording, argv[i]));
}

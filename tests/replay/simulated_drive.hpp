// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "replay_run.hpp"

namespace locus::test {

/// A drive of locus-sim, in a folder that is removed after the test.
class SimulatedDrive {
 public:
  SimulatedDrive(const std::string& world, const std::string& robot, int duration_s,
                 const std::vector<std::string>& more = {}, int seed = 1, const std::string& realism = "clean") {
    std::vector<std::string> arguments{"--world",    world,
                                       "--robot",    robot,
                                       "--duration", std::to_string(duration_s),
                                       "--realism",  realism,
                                       "--seed",     std::to_string(seed),
                                       "-o",         capture()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProgramRun run = run_program(LOCUS_SIM, arguments);
    EXPECT_EQ(run.status, 0) << run.err;
  }

  /// Replays the capture with additional arguments.
  [[nodiscard]] Replay replay(std::vector<std::string> arguments = {}) const {
    arguments.push_back(capture());
    return Replay(arguments);
  }
  [[nodiscard]] std::string capture() const { return folder_ / "capture"; }

 private:
  TemporaryFolder folder_;
};

/// Returns arguments for a fault that lasts one second in every five.
inline std::vector<std::string> a_second_in_five(const std::string& fault, double from_s, double to_s) {
  std::vector<std::string> arguments;
  for (double at_s = from_s; at_s < to_s; at_s += 5.0) {
    arguments.emplace_back("--fail");
    arguments.push_back(fmt::format("{}@{}-{}", fault, at_s, at_s + 1.0));
  }
  return arguments;
}

inline double ape_mean_m(const Replay& replay) { return replay.summary()["ape_m"]["mean"]; }

inline double without_imu_m(const SimulatedDrive& drive) { return ape_mean_m(drive.replay({"--fail", "imu:lost@0"})); }

} // namespace locus::test

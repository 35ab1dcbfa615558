// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "core/base/pose.hpp"
#include "core/base/stamp.hpp"
#include "drivers/files/motion_files.hpp"
#include "support/temporary_folder.hpp"

namespace locus::test {

std::string read_text(const std::filesystem::path& file);
std::vector<std::string> lines_of(const std::string& text);

/// Reads a trajectory; fails the test and returns an empty one on error.
std::vector<StampedPose> read_tum(const std::filesystem::path& file);

/// Writes a trajectory with its translations scaled by `factor`.
void write_scaled_tum(const std::filesystem::path& from, double factor, const std::filesystem::path& to);

/// Exit status and terminal output of a program.
struct ProgramRun {
  int status = -1; ///< exit status; -1: it crashed or never ran
  std::string out, err;
};
ProgramRun run_program(const std::string& program, const std::vector<std::string>& arguments);

/// One run of the real locus-replay, with its own output folder.
class Replay {
 public:
  /// Runs with these arguments and -o DIR.
  explicit Replay(std::vector<std::string> arguments);

  [[nodiscard]] const ProgramRun& run() const { return run_; }
  [[nodiscard]] std::filesystem::path file(const std::string& name) const { return folder_ / name; }
  [[nodiscard]] std::vector<StampedPose> trajectory() const { return read_tum(file("odometry.tum")); }
  [[nodiscard]] std::vector<std::vector<std::string>> table() const; ///< odometry.csv by row and column
  [[nodiscard]] nlohmann::json summary() const { return nlohmann::json::parse(read_text(file("summary.json"))); }

 private:
  TemporaryFolder folder_;
  ProgramRun run_;
};

} // namespace locus::test

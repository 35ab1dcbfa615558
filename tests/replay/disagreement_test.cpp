// SPDX-License-Identifier: Apache-2.0
// Messages about contradicting sensors: they name the contradiction and its possible causes, and blame no sensor.
#include <regex>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "simulated_drive.hpp"
#include "support/errors.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

/// Returns the first group of all matches of `pattern` in a text.
std::vector<std::string> found_in(const std::string& text, const std::string& pattern) {
  const std::regex regex(pattern);
  std::vector<std::string> found;
  for (std::sregex_iterator match(text.begin(), text.end(), regex), end; match != end; ++match)
    found.push_back((*match)[1]);
  return found;
}

/// Expects a sentence about a motion source to name lidar as well, and other possible causes.
void expect_blames_nobody(const std::string& sentence) {
  EXPECT_TRUE(contains(sentence, "and lidar disagree")) << sentence;
  EXPECT_TRUE(contains(sentence, "(possible causes: ")) << sentence;
  EXPECT_TRUE(contains(sentence, "stamps") || contains(sentence, "delay")) << sentence;
  EXPECT_TRUE(contains(sentence, "lidar that follows moving objects around the robot") ||
              contains(sentence, "people or objects that move around a robot"))
      << sentence;
}

/// Checks all messages of a run; returns the number of reported disagreements.
std::size_t disagreements_without_blame(const Replay& replay) {
  EXPECT_EQ(replay.run().status, 0) << replay.run().err;
  const std::vector<std::string> reasons = found_in(replay.run().out, R"(lost at [0-9.]+ s \(([^)]*)\))");
  for (const std::string& reason : reasons)
    EXPECT_TRUE(reason == "disagrees with lidar" || reason == "disagrees with lidar on turns") << reason;
  for (const std::string& line : lines_of(replay.run().err))
    expect_blames_nobody(line);
  const nlohmann::json summary = replay.summary();
  for (const auto& [name, source] : summary["sources"].items()) {
    if (source.contains("verdict"))
      expect_blames_nobody(source["verdict"]);
  }
  return reasons.size();
}

/// Only the stamps of the IMU are wrong. Simulated once per test process.
const SimulatedDrive& late_imu() {
  static const SimulatedDrive drive("urban", "husky", 80, {"--halts", "12", "--imu-late-ms", "100"}, 2);
  return drive;
}

/// The start of the replay determines whether the error is detected.
TEST(WrongStamps, OfAnImuAreReportedWithoutBlame) {
  const SimulatedDrive& drive = late_imu();
  std::size_t disagreements = disagreements_without_blame(drive.replay());
  for (const std::string start_s : {"20", "24", "48", "50", "56"}) {
    SCOPED_TRACE(start_s);
    disagreements += disagreements_without_blame(drive.replay({"--start", start_s, "--duration", "20"}));
  }
  EXPECT_GT(disagreements, 0U) << "otherwise nothing was tested";
}

/// Source and lidar agree again at the end, but for less than the probation of one second.
TEST(WrongStamps, OfAnImuUnusedAtTheEndAreAWarning) {
  const SimulatedDrive& drive = late_imu();
  int told = 0;
  for (const int start_s : {48, 50, 56}) {
    SCOPED_TRACE(start_s);
    const auto replay_for = [&](double duration_s) {
      return drive.replay({"--start", std::to_string(start_s), "--duration", fmt::format("{:.2f}", duration_s)});
    };
    const std::vector<std::string> back_s = found_in(replay_for(20).run().out, "imu .*back at ([0-9.]+) s");
    if (back_s.empty())
      continue;
    const Replay cut = replay_for(std::stod(back_s.back()) - start_s - 0.3);
    EXPECT_GT(disagreements_without_blame(cut), 0U);
    EXPECT_TRUE(contains(cut.run().err, "motion source imu and lidar disagreed on how the robot turns, and it was not "
                                        "yet used again at the end (possible causes: "))
        << cut.run().err;
    ++told;
  }
  EXPECT_GT(told, 0) << "otherwise nothing was tested";
}

/// Only the scale of the wheels is wrong. The available data cannot tell whether wheels or lidar are right.
TEST(Disagreement, OfWheelsAndLidarIsReportedOnce) {
  const TemporaryFolder folder;
  const std::string wheels = folder / "wheels.tum";
  write_scaled_tum(room_drive() / "wio.tum", 3.0, wheels);
  const Replay replay({"--odometry", "wio=" + wheels, room_drive().string()});
  EXPECT_GT(disagreements_without_blame(replay), 0U);
  EXPECT_FALSE(found_in(replay.run().out, R"((wio .*lost at [0-9.]+ s \(disagrees with lidar\)))").empty())
      << replay.run().out;
}

} // namespace
} // namespace locus::test

// SPDX-License-Identifier: Apache-2.0
// Output and errors of locus-replay --calibrate. Its accuracy is tested in imu_calibration_test.cpp.
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include "replay_run.hpp"
#include "support/child.hpp"
#include "support/temporary_folder.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

TEST(Calibrate, RunEqualsOneWithTheWrittenCalibration) {
  const TemporaryFolder folder;
  const std::string file = folder / "found.yaml";
  const Replay calibrated({"--calibrate", file, room_drive()});
  ASSERT_EQ(calibrated.run().status, 0) << calibrated.run().err;
  const YAML::Node sources = YAML::LoadFile(file)["motion_sources"];
  std::vector<std::string> arguments;
  for (const YAML::Node& source : sources)
    for (const auto& figure : source)
      if (const auto key = figure.first.as<std::string>(); key != "name")
        arguments.insert(arguments.end(), {"--set", "motion_sources." + source["name"].as<std::string>() + "." + key +
                                                        "=" + YAML::Dump(figure.second)});
  arguments.push_back(room_drive());
  const Replay configured(arguments);
  ASSERT_EQ(configured.run().status, 0) << configured.run().err;
  const auto last_m = [](const Replay& replay) { return replay.trajectory().back().T_source_base.translation; };
  EXPECT_LT((last_m(calibrated) - last_m(configured)).norm(), 0.002) << "except for rounding in the file";
}

TEST(Calibrate, InvalidCombinationsAreErrors) {
  const TemporaryFolder folder;
  const auto refusal = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"-o", folder / "out"});
    const ProgramRun run = run_program(LOCUS_REPLAY, arguments);
    EXPECT_EQ(run.status, 2) << run.err;
    return run.err;
  };
  const std::string file = folder / "found.yaml";
  EXPECT_NE(refusal({"--calibrate", file, "-"}).find("standard input cannot be read several times"), std::string::npos);
  EXPECT_NE(refusal({"--calibrate", file, "--realtime", room_drive()}).find("--realtime"), std::string::npos);
  EXPECT_NE(refusal({"--calibrate", folder / "out/summary.json", room_drive()}).find("choose another file"),
            std::string::npos);
  EXPECT_NE(refusal({"--calibrate", file, "--mcap", file, room_drive()}).find("choose another file"),
            std::string::npos);
  EXPECT_NE(refusal({"--calibrate", room_drive() / "found.yaml", room_drive()}).find("lies in"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(file));
}

} // namespace
} // namespace locus::test

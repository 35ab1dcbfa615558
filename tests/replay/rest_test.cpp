// SPDX-License-Identifier: Apache-2.0
// A robot that stands while people walk past it.
#include <filesystem>
#include <vector>

#include <gtest/gtest.h>

#include "replay/replay_run.hpp"
#include "support/test_data.hpp"

namespace locus::test {
namespace {

/// In an aisle nothing but the people shows the position along it. The walking robot stands until 2.8 s.
TEST(Rest, PeopleInAnAisleDoNotMoveARobotAtRest) {
  const std::filesystem::path drive = test_data() / "trial/spot";
  if (!std::filesystem::exists(drive))
    GTEST_SKIP() << drive << " is not here; set LOCUS_TEST_DATA";
  for (const char* start : {"0.5", "1", "1.5"}) {
    const Replay replay(
        {"--start", start, "--duration", "1", "--fail", "vio:lost@0", "--fail", "all-lidars:view=180@0", drive});
    ASSERT_EQ(replay.run().status, 0) << replay.run().err;
    const std::vector<StampedPose> poses = replay.trajectory();
    ASSERT_GE(poses.size(), 9U) << start;
    for (const StampedPose& pose : poses)
      EXPECT_LT((pose.T_source_base.translation - poses.front().T_source_base.translation).norm(), 0.05) << start;
  }
}

} // namespace
} // namespace locus::test

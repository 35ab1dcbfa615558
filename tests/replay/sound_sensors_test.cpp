// SPDX-License-Identifier: Apache-2.0
// Drives on which no sensor has a fault.
#include <gtest/gtest.h>

#include "simulated_drive.hpp"

namespace locus::test {
namespace {

/// About as many points of a field have a plane as decide whether voxels without one serve as correspondences.
TEST(SoundSensors, AreUsedInEverySweepOfAField) {
  for (const std::string realism : {"clean", "real"}) {
    SCOPED_TRACE(realism);
    const Replay replay = SimulatedDrive("field", "spot", 30, {}, 4, realism).replay();
    const nlohmann::json summary = replay.summary();
    EXPECT_EQ(summary["sweeps"]["without_source"], 0);
    EXPECT_EQ(summary["sources"]["imu"]["used_sweeps"], summary["sweeps"]["processed"].get<int>() - 1);
    EXPECT_LT(summary["ape_m"]["max"], 0.03);
  }
}

} // namespace
} // namespace locus::test

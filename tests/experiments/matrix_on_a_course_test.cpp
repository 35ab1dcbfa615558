// SPDX-License-Identifier: Apache-2.0
// The matrix of faults at reduced size: every cell on a drive of ten seconds.
#include <string>

#include <gtest/gtest.h>

#include "replay/replay_run.hpp"

namespace locus::test {
namespace {

using nlohmann::json;

TEST(FaultMatrix, EveryCellHoldsOnAShortDrive) {
  const TemporaryFolder folder;
  const ProgramRun run = run_program(LOCUS_EXPERIMENTS, {"--fault-matrix", "--realism", "clean", "--quiet",
                                                         "--duration", "10", "--jobs", "2", "-o", folder / "out"});
  ASSERT_EQ(run.status, 0) << run.err;
  const json cells = json::parse(read_text(folder / "out/results.json"))["matrix"]["cells"];
  EXPECT_EQ(cells.size(), 96U);
  for (const json& cell : cells) {
    if (!cell.contains("impossible")) {
      EXPECT_TRUE(cell["holds"]) << cell.dump(1);
    }
  }
  EXPECT_NE(read_text(folder / "out/matrix.md").find("| imu | frozen | yes"), std::string::npos);
}

} // namespace
} // namespace locus::test

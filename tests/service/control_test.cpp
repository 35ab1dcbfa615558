// SPDX-License-Identifier: Apache-2.0
#include <fstream>
#include <string>

#include "service/robot_network.hpp"

namespace locus::test {
namespace {

class Control : public RobotNetwork {};

TEST_F(Control, MistypedWordsNameTheNearestThatExists) {
  const auto refused = [](const ProgramRun& run, const std::string& words) {
    EXPECT_EQ(run.status, 2) << run.err;
    EXPECT_NE(run.err.find(words), std::string::npos) << run.err;
    EXPECT_EQ(lines_of(run.err).size(), 1U) << run.err;
  };
  refused(ctl({"statsu"}), "there is no command statsu; the nearest is status");
  refused(ctl({"status", "--jsno"}), "there is no option --jsno; the nearest is --json");
  refused(ctl({"--instnace=front", "status"}), "there is no option --instnace; the nearest is --instance");
  refused(run_program(LOCUSD, {"--chek-config"}), "there is no option --chek-config; the nearest is --check-config");
  refused(run_program(LOCUS_PLAY, {"--sped", "2", "drive"}), "there is no option --sped; the nearest is --speed");
  std::ofstream{file("bad.yaml")} << "dds:\n  domian: 3\n";
  refused(run_program(LOCUSD, {"--config", file("bad.yaml").string(), "--check-config"}), "'domain'");
}

} // namespace
} // namespace locus::test

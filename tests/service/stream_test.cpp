// SPDX-License-Identifier: Apache-2.0
// locus-sim -o - | locus-play -: a simulated robot without a recording.
#include "drivers/net/udp_socket.hpp"
#include "locus_sim/stream_text.hpp"
#include "service/robot_network.hpp"

namespace locus::test {
namespace {

using nlohmann::json;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr const char* kDrive = " --world urban --robot husky --duration 10 --seed 3 --realism clean -o ";

class Stream : public RobotNetwork {
 protected:
  static std::vector<std::string> shell(const std::string& command) {
    return {"/bin/bash", "-c", "set -o pipefail; " + command};
  }
  /// Runs locus-play with this standard input.
  static ProgramRun play(const std::string& from) {
    return run_program("/bin/bash", {"-c", from + " | " LOCUS_PLAY " -"});
  }
};

/// Records the same robot.
std::filesystem::path recorded(const std::filesystem::path& folder) {
  const ProgramRun run = run_program("/bin/sh", {"-c", LOCUS_SIM + std::string(kDrive) + folder.string()});
  EXPECT_EQ(run.status, 0) << run.err;
  return folder;
}

/// Counts the datagrams received, among them the truth, which no robot sends.
std::size_t texts_on_the_wire(UdpSocket& socket) {
  std::size_t count = 0;
  for (auto batch = socket.receive(); !batch.empty(); batch = socket.receive())
    count += batch.size();
  return count;
}

TEST_F(Stream, SimulatedRobotDrivesTheServiceWithoutAFile) {
  const std::filesystem::path folder = recorded(file("plant"));
  auto discard = UdpSocket::open(sim::kTextPort);
  ASSERT_TRUE(discard) << discard.error();
  Child daemon(led_locusd(folder / "config.yaml"));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  std::string play;
  for (const std::string& word : leading_play({"--fail", "wio:lost@4-8", "-"}))
    play += " " + word;
  Child robot(shell(LOCUS_SIM + std::string(kDrive) + "- |" + play));
  ASSERT_EQ(robot.wait_for_exit(patience_of_a_drive()), 0) << testing::PrintToString(robot.lines());

  EXPECT_TRUE(robot.has_line(std::to_string(datagrams_in(folder / "lidar.pcap")) + " packets sent"))
      << testing::PrintToString(robot.lines());
  EXPECT_EQ(texts_on_the_wire(*discard), 0U);
  const json status = status_when([](const json& s) { return s["lidars"].front()["heard_ms_ago"] > 500; });
  EXPECT_EQ(status["packets"]["total"]["lost"], 0);
  EXPECT_GE(status["sweeps"]["processed"], 98);
  EXPECT_NEAR(status["sources"]["wio"]["received"].get<int>(), 6 * 50, 5) << "lost for four of ten seconds";
  EXPECT_NEAR(status["sources"]["imu"]["received"].get<int>(), 10 * 200, 20);
  const auto truth = read_tum(folder / "gt.tum");
  const Pose driven = truth.front().T_source_base.inverse() * truth.back().T_source_base;
  const json& position_m = status["pose"]["xyz_m"];
  EXPECT_NEAR(std::hypot(position_m[0].get<double>(), position_m[1].get<double>()), driven.translation.head<2>().norm(),
              0.1);
}

/// A file of lidar packets alone is accepted as a stream.
TEST_F(Stream, CaptureFileIsSentWithoutConfigurationAndMotion) {
  const ProgramRun run = play("head -c 300000 " + (capture() / "lidar.pcap").string());
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_NE(run.err.find("locus-play: warning: -: byte 300000: the capture ends in mid-packet"), std::string::npos)
      << run.err;
  EXPECT_NE(run.out.find(" packets sent"), std::string::npos) << run.out;
}

TEST_F(Stream, InvalidStreamIsAnErrorOfOneLine) {
  const auto expect_refused = [](const std::string& from, int status, const std::string& said) {
    const ProgramRun run = play(from);
    EXPECT_EQ(run.status, status) << from;
    EXPECT_EQ(lines_of(run.err).size(), 1U) << run.err;
    EXPECT_NE(run.err.find(said), std::string::npos) << run.err;
  };
  expect_refused("true", 1, "locus-play: -: the file is empty (0 bytes)");
  expect_refused("yes", 1, "locus-play: -: a text file, not a pcap or pcapng capture");
  expect_refused(LOCUS_SIM + std::string(kDrive) + "- | sed 's/kind: odometry/kind: odometer/'", 2, "-: config.yaml:");
}

} // namespace
} // namespace locus::test

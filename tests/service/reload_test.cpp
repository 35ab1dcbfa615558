// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include "daemon/service/saved_state.hpp"
#include "drivers/net/udp_socket.hpp"
#include "service/robot_network.hpp"
#include "support/errors.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;

class Reload : public RobotNetwork {};

TEST_F(Reload, InvalidConfigurationLeavesTheOldOneInEffect) {
  const std::filesystem::path file = config();
  Child daemon(locusd(file));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  std::ofstream{file, std::ios::app} << "no_such_key: 1\n";
  const ProgramRun refused = ctl({"reload"});
  EXPECT_EQ(refused.status, 2);
  EXPECT_NE(refused.err.find("no_such_key"), std::string::npos) << refused.err;
  EXPECT_TRUE(daemon.wait_for_line("the old configuration remains in effect"));
  EXPECT_EQ(status()["state"], "waiting");
  static_cast<void>(config("threads: 1\n"));
  EXPECT_EQ(ctl({"reload"}).status, 0);
  EXPECT_EQ(status()["threads"], 1);
}

TEST_F(Reload, PortInUseLeavesTheOldConfigurationInEffect) {
  const std::filesystem::path file = config("flat_ground: off\n");
  Child daemon(locusd(file));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  const auto taken = UdpSocket::open(2399);
  ASSERT_TRUE(taken) << taken.error();
  std::filesystem::copy_file(lidar_with("port: 2399"), file, std::filesystem::copy_options::overwrite_existing);
  std::ofstream{file, std::ios::app} << "flat_ground: on\n";
  const ProgramRun refused = ctl({"reload"});
  EXPECT_EQ(refused.status, 1);
  EXPECT_TRUE(contains(refused.err, "UDP port 2399")) << refused.err;
  EXPECT_EQ(status()["lidars"]["front"]["port"], 2368);
  EXPECT_EQ(status()["flat_ground"], "off");
  ASSERT_EQ(ctl({"flat-ground", "auto"}).status, 0);
  EXPECT_EQ(ctl({"reload"}).status, 1);
  EXPECT_EQ(status()["flat_ground"], "auto");
}

/// Each reload takes longer than the interval to the next.
TEST_F(Reload, FrequentReloadsDelayNeitherAnswersNorTheStop) {
  Child daemon(locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  std::atomic<bool> stopping{false};
  std::thread pest([&] {
    for (; !stopping; std::this_thread::sleep_for(milliseconds{20}))
      daemon.signal(SIGHUP);
  });
  EXPECT_TRUE(daemon.wait_until([](const std::vector<std::string>& lines) {
    return std::ranges::count_if(lines, [](const std::string& line) { return line.ends_with("reloaded"); }) >= 3;
  }));
  EXPECT_EQ(status()["state"], "waiting");
  daemon.signal(SIGTERM);
  EXPECT_TRUE(daemon.wait_for_line("stopped"));
  stopping = true;
  pest.join();
  EXPECT_EQ(daemon.wait_for_exit(), 0);
}

/// Neither the new configuration nor the old one works: systemd restarts the service, which resumes from the saved
/// pose.
TEST_F(Reload, FailureOfBothConfigurationsEndsTheServiceWithItsStateSaved) {
  for (const bool by_signal : {false, true}) {
    std::ofstream calibration{this->file("unit.yaml")};
    calibration << "num_lasers: 16\nlasers:\n";
    for (int laser = 0; laser < 16; ++laser)
      calibration << fmt::format("- {{laser_id: {}, vert_correction: {}}}\n", laser, laser / 64.0);
    calibration.close();
    const std::filesystem::path file = config();
    const std::string right = read_text(file);
    std::filesystem::copy_file(lidar_with("calibration: " + this->file("unit.yaml").string()), file,
                               std::filesystem::copy_options::overwrite_existing);
    Child daemon(locusd(file));
    ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
    ASSERT_EQ(ctl({"reset", "--pose", "1,2,0,0,0,0"}).status, 0);
    std::filesystem::remove(this->file("unit.yaml"));
    const auto taken = UdpSocket::open(2399);
    ASSERT_TRUE(taken) << taken.error();
    std::filesystem::copy_file(lidar_with("port: 2399"), file, std::filesystem::copy_options::overwrite_existing);
    for (int signal = 0; by_signal && signal < 50; ++signal, std::this_thread::sleep_for(milliseconds{5}))
      daemon.signal(SIGHUP);
    if (!by_signal) {
      const ProgramRun reload = ctl({"reload"});
      EXPECT_TRUE(contains(reload.err, "the old configuration fails as well")) << reload.err;
    }
    EXPECT_EQ(daemon.wait_for_exit(), 1) << by_signal;
    const auto state = daemon::load_state(this->file("state"));
    ASSERT_TRUE(state) << state.error();
    EXPECT_EQ(state->last.T_odom_base.translation.y(), 2);
    std::ofstream{file} << right;
  }
}

} // namespace
} // namespace locus::test

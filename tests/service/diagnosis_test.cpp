// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <chrono>
#include <fstream>
#include <regex>
#include <thread>

#include <fmt/format.h>
#include <unistd.h>

#include "drivers/files/capture.hpp"
#include "drivers/files/motion_files.hpp"
#include "drivers/net/udp_socket.hpp"
#include "drivers/velodyne/model.hpp"
#include "service/robot_network.hpp"
#include "service/undisturbed.hpp"
#include "support/errors.hpp"
#include "support/udp_sender.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

/// What is wrong with the sensors, the network and the machine is said by the service itself.
class Diagnosis : public RobotNetwork {};

TEST_F(Diagnosis, SensorsThatAreNotHeardAreNamedWithTheInterfaceOfDds) {
  Child daemon(undisturbed(locusd(config())));
  EXPECT_TRUE(daemon.wait_for_line("motion source wio: not heard", seconds{7}));
  EXPECT_TRUE(daemon.wait_for_line("no publisher found for /wheel_odometry; DDS uses interface lo", milliseconds{10}));
  EXPECT_TRUE(daemon.wait_for_line("lidar front: no data packet on UDP port 2368", seconds{1}));
  EXPECT_EQ(status()["state"], "waiting");
  Child play(undisturbed({LOCUS_PLAY, capture().string()})); // switched on at last
  EXPECT_TRUE(daemon.wait_for_line("tracking", seconds{8}));
}

/// What is said changes with what is found: at first nothing comes.
TEST_F(Diagnosis, LidarOfAnotherAddressIsNamedWithBoth) {
  const std::filesystem::path wrong = lidar_with("source_ip: 192.168.1.77");
  Child daemon(undisturbed(locusd(wrong)));
  ASSERT_TRUE(daemon.wait_for_line("lidar front: no data packet on UDP port 2368 for 5 s; look at its power and cable",
                                   seconds{8}));
  const Child play(undisturbed({LOCUS_PLAY, capture().string()}));
  EXPECT_TRUE(daemon.wait_for_line("; packets come from 127.0.0.1, configured is 192.168.1.77: set "
                                   "lidars.front.source_ip to that of the lidar",
                                   seconds{5}))
      << testing::PrintToString(daemon.lines());
  const std::string shown = ctl({"status"}).out;
  EXPECT_NE(shown.find("refused: sender "), std::string::npos) << shown;
  EXPECT_NE(shown.find("the last sender: 127.0.0.1"), std::string::npos) << shown;
}

/// Half of what came was refused, and nobody said so.
TEST_F(Diagnosis, SecondLidarOnThePortIsNamedWithTheConfigurationOfBoth) {
  Child daemon(undisturbed(locusd(config())));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  const Child play(undisturbed({LOCUS_PLAY, capture().string()}));
  ASSERT_TRUE(daemon.wait_for_line("tracking", seconds{10}));
  std::jthread second([](const std::stop_token& stop) {
    const UdpSender lidar(INADDR_LOOPBACK + 1);
    const std::vector<std::byte> packet(velodyne::kDataPacketBytes);
    while (!stop.stop_requested()) {
      lidar.send(2368, packet);
      std::this_thread::sleep_for(milliseconds{5});
    }
  });
  EXPECT_TRUE(daemon.wait_for_line("lidar front: others send to its port 2368, too: the packets of 127.0.0.1 are read",
                                   seconds{8}))
      << testing::PrintToString(daemon.lines());
  EXPECT_TRUE(status_comes([](const nlohmann::json& status) { return status["lidars"]["front"]["model"] == "VLP-16"; },
                           seconds{1}));
  const std::string problem = status()["lidars"]["front"]["problem"];
  EXPECT_NE(problem.find("lidars: [{name: front, port: 2368, source_ip: 127.0.0.1}, "
                         "{name: front_2, port: 2368, source_ip: 127.0.0.2}]"),
            std::string::npos)
      << problem;
  second = {};
  EXPECT_TRUE(
      status_comes([](const nlohmann::json& status) { return status["lidars"]["front"]["problem"] == ""; }, seconds{8}))
      << "it sends no more";
}

/// Sends data packets as a VLP-16 does, but for their product id, until it is gone.
std::jthread unknown_device(const std::filesystem::path& capture, std::byte product_id,
                            std::uint32_t from_ip = INADDR_ANY) {
  std::vector<std::byte> packet;
  auto datagrams = Capture::open(capture / "lidar.pcap");
  while (packet.size() != velodyne::kDataPacketBytes) {
    const auto payload = datagrams->next()->payload;
    packet.assign(payload.begin(), payload.end());
  }
  packet[velodyne::kProductIdOffset] = product_id;
  return std::jthread([packet, from_ip](const std::stop_token& stop) {
    const UdpSender sender(from_ip);
    while (!stop.stop_requested()) {
      sender.send(2368, packet);
      std::this_thread::sleep_for(milliseconds{2});
    }
  });
}

TEST_F(Diagnosis, UnknownProductIdIsSaidByTheServiceAndByLocusctlSensors) {
  Child daemon(undisturbed(locusd(lidar_with("model: auto"))));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  const std::jthread device = unknown_device(capture(), std::byte{0x31});
  EXPECT_TRUE(
      daemon.wait_for_line("what comes is refused, for the reasons that locusctl status counts (product id 0x31 "
                           "and return mode 0x37 in ",
                           seconds{10}))
      << testing::PrintToString(daemon.lines());
  EXPECT_TRUE(daemon.wait_for_line("is it a lidar whose packets can be read, and lidars.front.model the right one?",
                                   milliseconds{10}));
  const ProgramRun alone = ctl({"sensors"});
  EXPECT_EQ(alone.status, 1);
  EXPECT_TRUE(contains(alone.err, "127.0.0.1       2368   not read: product id 0x31 and return mode 0x37 in "))
      << alone.err;
  EXPECT_TRUE(contains(alone.err, "no lidar was heard")) << alone.err;
}

/// What can be read is listed for the configuration, and the other device told of beside it.
TEST_F(Diagnosis, UnknownProductIdBesideALidarIsToldOnALineOfItsOwn) {
  const std::jthread device = unknown_device(capture(), std::byte{0x31}, INADDR_LOOPBACK + 1);
  const Child play({LOCUS_PLAY, capture().string()});
  ASSERT_TRUE(play.wait_for_line("nobody listens", seconds{5})) << "it waits for a service, and then sends";
  const ProgramRun both = ctl({"sensors"});
  EXPECT_EQ(both.status, 0) << both.err;
  EXPECT_TRUE(contains(both.out, "127.0.0.2       2368   not read: product id 0x31 and return mode 0x37 in "))
      << both.out;
  EXPECT_TRUE(contains(both.out, "model: VLP-16, port: 2368, T_base_lidar")) << both.out;
}

/// From the address of the lidar, so that its model alone tells it from one.
TEST_F(Diagnosis, UnknownProductIdIsNoProblemOfALidarAnyMoreOnceItIsGone) {
  Child daemon(undisturbed(locusd(lidar_with("model: auto"))));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  const Child play(undisturbed({LOCUS_PLAY, capture().string()}));
  ASSERT_TRUE(daemon.wait_for_line("tracking", seconds{10}));
  const auto problem_has = [](const std::string& part) {
    return [part](const nlohmann::json& status) {
      return contains(status["lidars"]["front"]["problem"].get<std::string>(), part);
    };
  };
  std::jthread device = unknown_device(capture(), std::byte{0x31});
  EXPECT_TRUE(status_comes(problem_has("refused product id 0x31"), seconds{3}));
  device = {};
  EXPECT_TRUE(status_comes([](const nlohmann::json& status) { return status["lidars"]["front"]["problem"] == ""; },
                           seconds{8}));
}

TEST_F(Diagnosis, LidarOnAnotherPortIsToldByItsPositionPackets) {
  const std::filesystem::path wrong = lidar_with("port: 2390");
  Child daemon(undisturbed(locusd(wrong)));
  const Child play(undisturbed({LOCUS_PLAY, capture().string()}));
  EXPECT_TRUE(daemon.wait_for_line("lidar front: no data packet on UDP port 2390 for 5 s; only its position packets "
                                   "arrive; find its data port with locusctl sensors and set lidars.front.port",
                                   seconds{8}))
      << testing::PrintToString(daemon.lines());
}

/// Beside a service that listens to the same.
TEST_F(Diagnosis, ConfigurationIsComparedWithTheWire) {
  const auto compare = [](const std::filesystem::path& with) {
    return run_program(LOCUSD, {"--config", with.string(), "--check-config", "--live"});
  };
  const ProgramRun silent = compare(config());
  EXPECT_EQ(silent.status, 1);
  EXPECT_TRUE(contains(silent.err, "locusd: lidar front: nothing comes to port 2368; look at power, cable"))
      << silent.err;
  EXPECT_TRUE(
      contains(silent.err, "locusd: odometry wio: topic /wheel_odometry: nobody publishes it in domain 0 on lo"))
      << silent.err;

  Child daemon(undisturbed(locusd(config())));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  const Child play(undisturbed({LOCUS_PLAY, capture().string()}));
  ASSERT_TRUE(daemon.wait_for_line("tracking", seconds{10}));
  const ProgramRun same = compare(config());
  EXPECT_EQ(same.status, 0) << same.err;
  const std::regex of_lidar{R"(lidar front: VLP-16 at 127\.0\.0\.1 to port 2368, (\d+) packets/s)"};
  std::smatch rate;
  ASSERT_TRUE(std::regex_search(same.out, rate, of_lidar)) << same.out;
  EXPECT_NEAR(std::stod(rate[1]), 754, 38) << "a twentieth: on a busy machine packets of a second come in less";
  EXPECT_TRUE(contains(same.out, "imu imu: topic /imu/data: ")) << same.out;
  EXPECT_TRUE(contains(same.out, "odometry wio: topic /wheel_odometry: ")) << same.out;

  const ProgramRun port = compare(lidar_with("port: 2390"));
  EXPECT_EQ(port.status, 1);
  EXPECT_TRUE(contains(port.err,
                       "lidar front: nothing comes to port 2390; VLP-16 at 127.0.0.1 sends to port 2368; if it "
                       "is that one, set port and source_ip in the entry of front"))
      << port.err;
  const ProgramRun model = compare(lidar_with("model: HDL-32E"));
  EXPECT_EQ(model.status, 1);
  EXPECT_TRUE(contains(model.err, "is configured as HDL-32E, and its packets say VLP-16")) << model.err;
  std::ofstream{file("kind.yaml")} << std::regex_replace(read_text(config()), std::regex{"kind: odometry"},
                                                         "kind: imu");
  const ProgramRun kind = compare(file("kind.yaml"));
  EXPECT_EQ(kind.status, 1);
  EXPECT_TRUE(contains(kind.err, "imu wio: topic /wheel_odometry: is published as nav_msgs::msg::dds_::Odometry_"))
      << kind.err;
  EXPECT_EQ(status()["packets"]["total"]["lost"], 0) << "the service was disturbed";
}

TEST_F(Diagnosis, AccelerationsInGAreNamed) {
  const std::filesystem::path drive = file("in_g");
  std::filesystem::copy(capture(), drive);
  auto samples = MotionSamples<ImuSample>::open((capture() / "imu.csv").string());
  ASSERT_TRUE(samples) << samples.error();
  std::ofstream imu(drive / "imu.csv");
  for (const ImuSample& sample : samples->drain()) {
    imu << sample.stamp.time_since_epoch().count();
    for (const Eigen::Vector3d& axes :
         {sample.angular_velocity_radps, Eigen::Vector3d(sample.specific_force_mps2 / 9.80665)})
      imu << ',' << axes.x() << ',' << axes.y() << ',' << axes.z();
    imu << '\n';
  }
  imu.close();
  Child daemon(undisturbed(locusd(config())));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  const Child play(undisturbed({LOCUS_PLAY, drive.string()}));
  EXPECT_TRUE(daemon.wait_for_line(
      "motion source imu reports accelerations of about 1 where gravity is 9.8 m/s^2, as if in g", seconds{15}))
      << testing::PrintToString(daemon.lines());
  EXPECT_NE(ctl({"status"}).out.find("as if in g"), std::string::npos);
}

/// Wheels of which nothing is wrong but the scale, and lidar: who is right is not known to the service.
TEST_F(Diagnosis, WheelsAndLidarThatDisagreeAreSaidWithAllPossibleCauses) {
  const std::filesystem::path drive = file("scaled");
  std::filesystem::copy(capture(), drive);
  write_scaled_tum(capture() / "wio.tum", 3.0, drive / "wio.tum");
  Child daemon(undisturbed(locusd(config())));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  const Child play(undisturbed({LOCUS_PLAY, drive.string()}));
  EXPECT_TRUE(daemon.wait_for_line(
      "motion source wio and lidar disagree on how the robot moves; it is not used until they agree (possible causes: "
      "its slip, scale or stamps, an IMU whose stamps are late, or lidar that follows what moves around the robot); "
      "the next best one is used",
      seconds{20}))
      << testing::PrintToString(daemon.lines());
  EXPECT_TRUE(daemon.wait_for_line("Z_contradiction", seconds{10})) << "the input before it is kept";
  const nlohmann::json incidents = status()["incidents"];
  EXPECT_EQ(incidents["kept"], 1);
  EXPECT_LE(incidents["suppressed"], 1) << "samples that are refused one after another are one contradiction";
  EXPECT_EQ(incidents["dropped"], 0);
}

TEST_F(Diagnosis, SweepsThatAreDroppedAreSaidWithTheReason) {
  Child daemon(undisturbed(locusd(config())));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  const Child play(undisturbed({LOCUS_PLAY, capture().string()}));
  ASSERT_TRUE(daemon.wait_for_line("tracking", seconds{10}));
  const Child hang({HANG_THREAD, std::to_string(daemon.pid()), "odometry"});
  EXPECT_TRUE(daemon.wait_for_line("this computer is too busy: ", seconds{12}))
      << testing::PrintToString(daemon.lines());
}

TEST_F(Diagnosis, SweepsThatAreShorterThanATurnAreSaidOnce) {
  Child daemon(undisturbed(locusd(config("sweep_period_ms: 50\n"))));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up", seconds{10}));
  const Child play(undisturbed({LOCUS_PLAY, capture().string()}));
  EXPECT_TRUE(daemon.wait_for_line("lidar front: one revolution takes 100 ms, so each sweep of 50 ms covers only",
                                   seconds{10}));
  std::this_thread::sleep_for(seconds{1});
  const auto lines = daemon.lines();
  EXPECT_EQ(std::ranges::count_if(
                lines, [](const std::string& line) { return contains(line, "one revolution takes 100 ms"); }),
            1);
}

/// Without the right to go beyond what the kernel allows to all, as systemd starts it.
TEST_F(Diagnosis, BufferThatIsSmallerThanAskedForIsSaidWithTheSettingToChange) {
  int allowed = UdpSocket::kWantedBufferBytes;
  std::ifstream("/proc/sys/net/core/rmem_max") >> allowed;
  if (allowed >= UdpSocket::kWantedBufferBytes)
    GTEST_SKIP() << "this machine gives all that is asked for";
  std::vector<std::string> command = locusd(config());
  if (geteuid() == 0)
    command.insert(command.begin(), {"/usr/bin/setpriv", "--bounding-set", "-net_admin"});
  Child daemon(command);
  EXPECT_TRUE(
      daemon.wait_for_line(fmt::format("the kernel gives lidar sockets {} bytes of the 8388608 asked for: packets "
                                       "will be lost under load; sysctl net.core.rmem_max=8388608",
                                       allowed),
                           seconds{5}))
      << testing::PrintToString(daemon.lines());
}

} // namespace
} // namespace locus::test

// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <chrono>
#include <fstream>
#include <iterator>
#include <regex>
#include <thread>

#include <fmt/format.h>
#include <unistd.h>

#include "daemon/service/status.hpp"
#include "drivers/files/capture.hpp"
#include "drivers/files/motion_files.hpp"
#include "drivers/net/udp_socket.hpp"
#include "drivers/velodyne/model.hpp"
#include "service/robot_network.hpp"
#include "support/errors.hpp"
#include "support/udp_sender.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;

/// Diagnostics of sensors, network and machine that the service itself reports.
class Diagnosis : public RobotNetwork {};

TEST_F(Diagnosis, SilentSensorsAreReportedWithTheDdsInterface) {
  Child daemon(locusd(config()));
  EXPECT_TRUE(daemon.wait_for_line("motion source wio: nothing received"));
  EXPECT_TRUE(daemon.wait_for_line("no publisher found for /wheel_odometry; DDS uses interface lo"));
  EXPECT_TRUE(daemon.wait_for_line("lidar front: no data packet on UDP port 2368"));
  EXPECT_EQ(status()["state"], "waiting");
  Child play(endlessly(capture())); // sensors switched on
  EXPECT_TRUE(daemon.wait_for_line("tracking"));
}

/// The message follows the diagnosis: at first there are no packets at all.
TEST_F(Diagnosis, LidarAtAnotherAddressIsReportedWithBothAddresses) {
  const std::filesystem::path wrong = lidar_with("source_ip: 192.168.1.77");
  Child daemon(locusd(wrong));
  ASSERT_TRUE(daemon.wait_for_line("lidar front: no data packet on UDP port 2368 for 5 s; check its power and cable"));
  const Child play(endlessly(capture()));
  EXPECT_TRUE(daemon.wait_for_line("; packets come from 127.0.0.1, configured is 192.168.1.77: set "
                                   "lidars.front.source_ip to that of the lidar"))
      << testing::PrintToString(daemon.lines());
  const std::string shown = ctl({"status"}).out;
  EXPECT_NE(shown.find("rejected: sender "), std::string::npos) << shown;
  EXPECT_NE(shown.find("the last sender: 127.0.0.1"), std::string::npos) << shown;
}

/// Regression: half of the packets were rejected without a message.
TEST_F(Diagnosis, SecondLidarOnThePortIsReportedWithAConfigurationForBoth) {
  Child daemon(locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  const Child play(endlessly(capture()));
  ASSERT_TRUE(daemon.wait_for_line("tracking"));
  std::jthread second([](const std::stop_token& stop) {
    const UdpSender lidar(INADDR_LOOPBACK + 1);
    const std::vector<std::byte> packet(velodyne::kDataPacketBytes);
    while (!stop.stop_requested()) {
      lidar.send(2368, packet);
      std::this_thread::sleep_for(milliseconds{5});
    }
  });
  EXPECT_TRUE(daemon.wait_for_line("lidar front: other senders use its port 2368: packets from 127.0.0.1 are used"))
      << testing::PrintToString(daemon.lines());
  EXPECT_TRUE(
      status_comes([](const nlohmann::json& status) { return status["lidars"]["front"]["model"] == "VLP-16"; }));
  const std::string problem = status()["lidars"]["front"]["problem"];
  EXPECT_NE(problem.find("lidars: [{name: front, port: 2368, source_ip: 127.0.0.1}, "
                         "{name: front_2, port: 2368, source_ip: 127.0.0.2}]"),
            std::string::npos)
      << problem;
  second = {};
  EXPECT_TRUE(status_comes([](const nlohmann::json& status) { return status["lidars"]["front"]["problem"] == ""; }))
      << "it sends no more";
}

/// Sends data packets of a VLP-16 with another product id until it is destroyed.
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

TEST_F(Diagnosis, UnknownProductIdIsReportedByServiceAndSensors) {
  Child daemon(locusd(lidar_with("model: auto")));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  const std::jthread device = unknown_device(capture(), std::byte{0x31});
  EXPECT_TRUE(daemon.wait_for_line("its packets are rejected (product id 0x31 "
                                   "and return mode 0x37 in "))
      << testing::PrintToString(daemon.lines());
  EXPECT_TRUE(daemon.wait_for_line("Check that the lidar is of a supported model, and lidars.front.model"));
  const ProgramRun alone = ctl({"sensors"});
  EXPECT_EQ(alone.status, 1);
  EXPECT_TRUE(contains(alone.err, "127.0.0.1       2368   not read: product id 0x31 and return mode 0x37 in "))
      << alone.err;
  EXPECT_TRUE(contains(alone.err, "no lidar that can be read was received")) << alone.err;
}

/// Readable lidars are listed with their configuration, the unknown device on a separate line.
TEST_F(Diagnosis, UnknownProductIdBesideALidarHasItsOwnLine) {
  const std::jthread device = unknown_device(capture(), std::byte{0x31}, INADDR_LOOPBACK + 1);
  const Child play(endlessly(capture()));
  ASSERT_TRUE(play.wait_for_line("has no subscriber")) << "it waits for a service, and then sends";
  const ProgramRun both = ctl({"sensors"});
  EXPECT_EQ(both.status, 0) << both.err;
  EXPECT_TRUE(contains(both.out, "127.0.0.2       2368   not read: product id 0x31 and return mode 0x37 in "))
      << both.out;
  EXPECT_TRUE(contains(
      both.out, "    model: VLP-16  # by its packets\n    port: 2368  # where its packets go\n    T_base_lidar: "))
      << both.out;
}

/// The packets have the lidar's address; only the model differs.
TEST_F(Diagnosis, UnknownProductIdIsNoProblemOnceItsSenderIsGone) {
  Child daemon(locusd(lidar_with("model: auto")));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  const Child play(endlessly(capture()));
  ASSERT_TRUE(daemon.wait_for_line("tracking"));
  const auto problem_has = [](const std::string& part) {
    return [part](const nlohmann::json& status) {
      return contains(status["lidars"]["front"]["problem"].get<std::string>(), part);
    };
  };
  std::jthread device = unknown_device(capture(), std::byte{0x31});
  EXPECT_TRUE(status_comes(problem_has("rejected product id 0x31")));
  device = {};
  EXPECT_TRUE(status_comes([](const nlohmann::json& status) { return status["lidars"]["front"]["problem"] == ""; }));
}

TEST_F(Diagnosis, LidarOnAnotherPortIsDetectedByItsPositionPackets) {
  const std::filesystem::path wrong = lidar_with("port: 2390");
  Child daemon(locusd(wrong));
  const Child play(endlessly(capture()));
  EXPECT_TRUE(daemon.wait_for_line(
      "lidar front: no data packet on UDP port 2390 for 5 s; only its position packets "
      "arrive; its laser or motor is off (see its web page), or its data packets go to another port "
      "(locusctl sensors): set lidars.front.port"))
      << testing::PrintToString(daemon.lines());
}

const std::regex kRateOfLidar{R"(lidar front: VLP-16 at 127\.0\.0\.1 to port 2368, (\d+) packets/s)"};

/// Runs beside a service that receives the same packets and is not disturbed.
TEST_F(Diagnosis, ConfigurationIsComparedWithTheNetwork) {
  const auto compare = [](const std::filesystem::path& with) {
    return run_program(LOCUSD, {"--config", with.string(), "--check-config", "--live"});
  };
  const ProgramRun silent = compare(config());
  EXPECT_EQ(silent.status, 1);
  EXPECT_TRUE(contains(silent.err, "locusd: lidar front: no packets arrive at port 2368; check its power, its cable"))
      << silent.err;
  EXPECT_TRUE(contains(silent.err, "locusd: odometry wio: topic /wheel_odometry: no publisher in domain 0 on lo"))
      << silent.err;

  const Child daemon(locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  const Child play(endlessly(capture()));
  ASSERT_TRUE(daemon.wait_for_line("tracking"));
  const ProgramRun same = compare(config());
  EXPECT_EQ(same.status, 0) << same.err;
  EXPECT_TRUE(std::regex_search(same.out, kRateOfLidar)) << same.out;
  EXPECT_TRUE(contains(same.out, "imu imu: topic /imu/data: ")) << same.out;
  EXPECT_TRUE(contains(same.out, "odometry wio: topic /wheel_odometry: ")) << same.out;

  const ProgramRun port = compare(lidar_with("port: 2390"));
  EXPECT_EQ(port.status, 1);
  EXPECT_TRUE(contains(port.err, "lidar front: no packets arrive at port 2390; VLP-16 at 127.0.0.1 sends to port 2368; "
                                 "if that is the lidar, set port and source_ip in the entry of front"))
      << port.err;
  const ProgramRun model = compare(lidar_with("model: HDL-32E"));
  EXPECT_EQ(model.status, 1);
  EXPECT_TRUE(contains(model.err, "is configured as HDL-32E, but its packets are of VLP-16")) << model.err;
  std::ofstream{file("kind.yaml")} << std::regex_replace(read_text(config()), std::regex{"kind: odometry"},
                                                         "kind: imu");
  const ProgramRun kind = compare(file("kind.yaml"));
  EXPECT_EQ(kind.status, 1);
  EXPECT_TRUE(contains(kind.err, "imu wio: topic /wheel_odometry: is published as nav_msgs::msg::dds_::Odometry_"))
      << kind.err;
  const auto packets = [](const nlohmann::json& status) { return status["packets"]["total"]["data"].get<int>(); };
  const int before = packets(status());
  EXPECT_TRUE(status_comes([&](const nlohmann::json& status) { return packets(status) > before; }));
}

/// Depends on the speed of the machine.
TEST_F(Diagnosis, ComparisonCountsTrafficWithoutDisturbingTheService) {
  const Child daemon(locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  const Child play({LOCUS_PLAY, capture().string()});
  ASSERT_TRUE(daemon.wait_for_line("tracking"));
  const ProgramRun same = run_program(LOCUSD, {"--config", config().string(), "--check-config", "--live"});
  std::smatch rate;
  ASSERT_TRUE(std::regex_search(same.out, rate, kRateOfLidar)) << same.out << same.err;
  EXPECT_NEAR(std::stod(rate[1]), 754, 38) << "a twentieth: on a busy machine packets of a second come in less";
  EXPECT_EQ(status()["packets"]["total"]["lost"], 0) << "the service was disturbed";
}

TEST_F(Diagnosis, AccelerationsInGAreReported) {
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
  const Child daemon(led_locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  const Child play(leading_play({drive.string()}));
  EXPECT_TRUE(
      daemon.wait_for_line("motion source imu reports accelerations of about 1 where gravity is 9.8 m/s^2, as if in g"))
      << testing::PrintToString(daemon.lines());
  EXPECT_NE(ctl({"status"}).out.find("as if in g"), std::string::npos);
}

/// Only the scale of the wheels is wrong. The service cannot know whether wheels or lidar are right.
TEST_F(Diagnosis, DisagreementOfWheelsAndLidarIsReportedWithItsPossibleCauses) {
  const std::filesystem::path drive = file("scaled");
  std::filesystem::copy(capture(), drive);
  write_scaled_tum(capture() / "wio.tum", 3.0, drive / "wio.tum");
  const Child daemon(led_locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  const Child play(leading_play({drive.string()}));
  EXPECT_TRUE(daemon.wait_for_line(
      "motion source wio and lidar disagree on how the robot moves; it is not used until they agree (possible causes: "
      "its slip, scale or stamps, an IMU whose stamps are late, or lidar that follows moving objects around the "
      "robot); "
      "the next best one is used"))
      << testing::PrintToString(daemon.lines());
  EXPECT_TRUE(daemon.wait_for_line("Z_contradiction")) << "the input before it is kept";
  EXPECT_EQ(status()["incidents"]["kept"], 1);
}

/// A source of which every sample was refused was refused in silence.
TEST_F(Diagnosis, SourceWithoutAnAcceptedSampleIsReportedWithTheReasonWhereverOneLooks) {
  const std::string why = "it sends values that are not numbers, or too large for any sensor (check its driver)";
  const auto has_reason = [&](const std::string& text) { return contains(text, why); };
  const Child daemon(led_locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  const Child listener({CYCLONE_PEER, "0", "listen", "/locus"});
  ASSERT_TRUE(hears_the_service(listener));
  const Child play(leading_play({"--fail", "wio:nan@0", capture().string()}));
  EXPECT_TRUE(daemon.wait_for_line("motion source wio is lost (nan): " + why + "; the next best one is used"))
      << testing::PrintToString(daemon.lines());
  EXPECT_TRUE(status_comes([&](const nlohmann::json& status) {
    const auto& wio = status["sources"]["wio"];
    return has_reason(wio["verdict"].get<std::string>()) && wio["rejected"]["nan"] == wio["received"];
  }));
  EXPECT_TRUE(has_reason(ctl({"status"}).out));
  EXPECT_TRUE(listener.wait_until([&](const std::vector<std::string>& lines) {
    return std::ranges::any_of(lines, [&](const std::string& line) {
      return line.starts_with("diagnostics_message locusd: source wio: ") && has_reason(line);
    });
  })) << testing::PrintToString(listener.lines_of("diagnostics_message"));
}

TEST_F(Diagnosis, DroppedSweepsAreReportedWithTheReason) {
  Child daemon(locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  const Child play(endlessly(capture()));
  ASSERT_TRUE(daemon.wait_for_line("tracking"));
  const Child hang({HANG_THREAD, std::to_string(daemon.pid()), "odometry"});
  EXPECT_TRUE(daemon.wait_for_line("this computer is overloaded: ")) << testing::PrintToString(daemon.lines());
}

TEST_F(Diagnosis, SweepsShorterThanARevolutionAreReportedOnce) {
  Child daemon(locusd(config("sweep_period_ms: 50\n")));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  const Child play(endlessly(capture()));
  EXPECT_TRUE(daemon.wait_for_line("lidar front: one revolution takes 100 ms, so each sweep of 50 ms covers only"));
  const auto sweeps = [](const nlohmann::json& status) { return status["sweeps"]["seen"].get<int>(); };
  const int before = sweeps(status());
  EXPECT_TRUE(status_comes([&](const nlohmann::json& status) { return sweeps(status) > before + 20; }));
  const auto lines = daemon.lines();
  EXPECT_EQ(std::ranges::count_if(
                lines, [](const std::string& line) { return contains(line, "one revolution takes 100 ms"); }),
            1);
}

/// The service's monitoring with figures and time set by the test.
class SessionMonitorTest : public testing::Test {
 protected:
  void SetUp() override {
    figures_.live = daemon::Figures::Live{};
    figures_.live->link.sources.resize(config_.motion_sources.size());
    static_cast<void>(said_after(Duration::zero()));
  }

  /// Returns the messages of a check this long after the previous one.
  std::vector<std::string> said_after(Duration time) {
    now_ += time;
    figures_.duration += time;
    testing::internal::CaptureStderr();
    monitor_.check(figures_);
    return lines_of(testing::internal::GetCapturedStderr());
  }
  daemon::IngestReport::Lidar& lidar() { return figures_.ingest.lidars.front(); }

  static constexpr Duration kPatience = daemon::SessionMonitor::kPatience;
  static inline Duration now_ = std::chrono::hours{1};
  static Duration read_now(clockid_t /*clock*/) { return now_; }
  Config config_;
  daemon::Figures figures_{config_};
  daemon::Log log_{read_now};
  daemon::SessionMonitor monitor_{config_, {}, log_, read_now};
};

using Lines = std::vector<std::string>;

TEST_F(SessionMonitorTest, ReportsASilentLidarAfterFiveSecondsOncePerReason) {
  EXPECT_EQ(said_after(kPatience - Duration{1}), Lines{});
  EXPECT_EQ(said_after(Duration{1}),
            Lines{"locusd: warning: lidar front: no data packet on UDP port 2368 for 5 s; check its power and cable, "
                  "and the address it sends to (locusctl sensors)"});
  EXPECT_EQ(said_after(kPatience), Lines{});

  lidar().packets.received = lidar().packets.position = 3;
  EXPECT_EQ(said_after(std::chrono::seconds{1}),
            Lines{"locusd: warning: lidar front: no data packet on UDP port 2368 for 11 s; only its position packets "
                  "arrive; its laser or motor is off (see its web page), or its data packets go to another port "
                  "(locusctl sensors): set lidars.front.port"});
  lidar().packets.received += 2;
  lidar().packets[PacketError::sender] = 2;
  lidar().refused_ip = INADDR_LOOPBACK;
  lidar().source_ip = INADDR_LOOPBACK + 1;
  EXPECT_EQ(
      said_after(std::chrono::seconds{1}),
      Lines{"locusd: warning: lidar front: no data packet on UDP port 2368 for 12 s; packets come from 127.0.0.1, "
            "the lidar was 127.0.0.2: set lidars.front.source_ip to that of the lidar"});
  EXPECT_EQ(said_after(std::chrono::hours{1}), Lines{});

  lidar().packets.data = 1;
  EXPECT_EQ(said_after(Duration{1}), Lines{"locusd: lidar front: data received"});
  EXPECT_EQ(said_after(kPatience - Duration{1}), Lines{});
  EXPECT_EQ(said_after(Duration{1}).size(), 1U) << "again silent";
}

/// Two other lidars send to its port, in turn.
TEST_F(SessionMonitorTest, LogsLittleInTenMinutesWithoutALidar) {
  figures_.live->link.connected = true;
  for (daemon::LinkFigures::Source& source : figures_.live->link.sources)
    source.received = 1;
  lidar().source_ip = INADDR_LOOPBACK + 7;
  Lines said;
  for (unsigned check = 0; check < 2400; ++check) {
    ++lidar().packets.received;
    ++lidar().packets[PacketError::sender];
    lidar().refused_ip = INADDR_LOOPBACK + check % 2;
    std::ranges::copy(said_after(milliseconds{250}), std::back_inserter(said));
  }
  EXPECT_LT(said.size(), 10U) << testing::PrintToString(said);
  EXPECT_TRUE(std::ranges::any_of(said, [](const std::string& line) { return contains(line, "packets come from"); }));
}

TEST_F(SessionMonitorTest, ReportsASilentSourceFiveSecondsAfterTheStart) {
  figures_.live->link.connected = true;
  const Lines up = said_after(Duration{1});
  ASSERT_EQ(up.size(), 1U);
  EXPECT_TRUE(contains(up.front(), "DDS is up: domain 0 on interface "));
  figures_.live->link.sources[1].received = 1;
  lidar().packets.data = 1;
  EXPECT_EQ(said_after(kPatience - Duration{1}), Lines{});
  ++lidar().packets.data;
  const Lines unheard = said_after(Duration{1});
  ASSERT_EQ(unheard.size(), 1U);
  EXPECT_TRUE(contains(unheard.front(),
                       "motion source wio: nothing received since the start, 5 s ago: no publisher found for "
                       "/wheel_odometry; DDS uses interface "))
      << unheard.front();
  ++lidar().packets.data;
  EXPECT_EQ(said_after(Duration{1}), Lines{}) << "once";
}

TEST_F(SessionMonitorTest, ReportsDroppedSweepsEveryFiveSeconds) {
  figures_.counters.dropped = 1;
  EXPECT_EQ(said_after(kPatience - Duration{1}), Lines{});
  figures_.counters.dropped = 4;
  lidar().packets.data = 1;
  EXPECT_TRUE(contains(said_after(Duration{1}).at(0), "this computer is overloaded: 4 sweeps were dropped within 5 s"));
  figures_.counters.dropped = 5;
  ++lidar().packets.data;
  EXPECT_TRUE(contains(said_after(kPatience).at(0), "this computer is overloaded: 1 sweeps were dropped within 5 s"));
  ++lidar().packets.data;
  EXPECT_EQ(said_after(kPatience), Lines{});
}

/// Without the capability to exceed the kernel's limit, as under systemd.
TEST_F(Diagnosis, SmallSocketBufferIsReportedWithTheSettingToChange) {
  int allowed = UdpSocket::kWantedBufferBytes;
  std::ifstream("/proc/sys/net/core/rmem_max") >> allowed;
  if (allowed >= UdpSocket::kWantedBufferBytes)
    GTEST_SKIP() << "this machine gives all that is asked for";
  std::vector<std::string> command = locusd(config());
  if (geteuid() == 0)
    command.insert(command.begin(), {"/usr/bin/setpriv", "--bounding-set", "-net_admin"});
  Child daemon(command);
  EXPECT_TRUE(daemon.wait_for_line(fmt::format("the kernel grants lidar sockets {} of the 8388608 bytes requested: "
                                               "packets will be lost under load; set sysctl net.core.rmem_max=8388608",
                                               allowed)))
      << testing::PrintToString(daemon.lines());
}

} // namespace
} // namespace locus::test

// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/capture_writer.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <stdexcept>
#include <string>

#include "drivers/files/capture.hpp"
#include "support/scenes.hpp"

namespace locus::sim {
namespace {

using std::chrono::seconds;

class CaptureFolder : public testing::Test {
 protected:
  CaptureFolder() : folder_(std::filesystem::path(testing::TempDir()) / test_name()) {
    std::filesystem::remove_all(folder_);
  }
  ~CaptureFolder() override { std::filesystem::remove_all(folder_); }

  static std::string test_name() { return testing::UnitTest::GetInstance()->current_test_info()->name(); }

  [[nodiscard]] std::size_t lines(const char* file) const {
    std::ifstream stream(folder_ / file);
    std::size_t count = 0;
    for (std::string line; std::getline(stream, line);)
      ++count;
    return count;
  }

  std::filesystem::path folder_;
  Scene scene_ = room();
  Trajectory trajectory_{room_course(seconds{3}, 1.0), room_start()};
};

TEST_F(CaptureFolder, ContainsBothLidarsInOrderOfArrivalAndAllMotion) {
  RobotOptions robot;
  robot.lidars = {{"front", {}}, {"rear", {.port = 2369, .source_ip = 0xC0A8'01CA, .sends_position_packets = true}}};
  write_capture_folder(folder_, scene_, trajectory_, seconds{2}, robot);

  auto capture = Capture::open(folder_ / "lidar.pcap");
  ASSERT_TRUE(capture) << capture.error();
  std::map<int, int> packets;
  Stamp last;
  while (const Datagram* datagram = capture->next()) {
    EXPECT_GE(datagram->receive_stamp, last);
    last = datagram->receive_stamp;
    ++packets[datagram->destination_port];
  }
  EXPECT_EQ(packets[2368], 1507); // 2 s / 1.327 ms
  EXPECT_EQ(packets[2369], 1507);
  EXPECT_EQ(packets[8308], 301);
  EXPECT_TRUE(capture->warnings().empty());
  EXPECT_EQ(lines("imu.csv"), 402U); // a header, then 200 Hz with both ends
  EXPECT_EQ(lines("wio.tum"), 101U);
  EXPECT_EQ(lines("gt.tum"), 201U);
  EXPECT_EQ(lines("config.yaml"), 6U);
}

TEST_F(CaptureFolder, HasNoFilesOfAbsentSensors) {
  write_capture_folder(folder_, scene_, trajectory_, seconds{1}, {.imu = {}, .odometry = {}});
  EXPECT_TRUE(std::filesystem::exists(folder_ / "lidar.pcap"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "imu.csv"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "wio.tum"));
}

TEST_F(CaptureFolder, UnwritableFolderIsAnError) {
  std::ofstream(folder_) << "a file where the folder should be";
  EXPECT_THROW(write_capture_folder(folder_, scene_, trajectory_, seconds{1}, {}), std::runtime_error);
}

} // namespace
} // namespace locus::sim

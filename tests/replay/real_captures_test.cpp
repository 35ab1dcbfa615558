// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "drivers/files/capture.hpp"
#include "drivers/lidar_input.hpp"
#include "replay_run.hpp"
#include "support/returns.hpp"
#include "support/test_data.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;

/// Captures of real sensors, through the program as users run it: lidar alone, no configuration.
class RealCapture : public testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(test_data()))
      GTEST_SKIP() << "no real captures in " << test_data() << "; set LOCUS_TEST_DATA";
  }
  static std::filesystem::path capture_file(const std::string& name) {
    return test_data() / "velodyne" / (name + ".pcap");
  }
  static Replay replay(const std::string& name) { return Replay({capture_file(name).string()}); }

  /// The poses up to `duration` after the first.
  static void expect_still(const std::vector<StampedPose>& trajectory, Duration duration) {
    ASSERT_FALSE(trajectory.empty());
    double moved_m = 0, turned_deg = 0;
    for (const StampedPose& row : trajectory) {
      if (row.stamp - trajectory.front().stamp > duration)
        break;
      moved_m = std::max(moved_m, row.T_source_base.translation.norm());
      turned_deg = std::max(turned_deg, angle_rad(row.T_source_base.rotation) / kRadPerDeg);
    }
    EXPECT_LT(moved_m, 0.02);
    EXPECT_LT(turned_deg, 0.1);
  }
};

/// The median, over the first or the last of a time, of something that a moving lidar measures again and again.
class MedianOverTime {
 public:
  void add(Stamp stamp, double value) { samples_.push_back({stamp, value}); }
  [[nodiscard]] double over_first(Duration duration) const {
    return median([end = samples_.front().stamp + duration](Stamp stamp) { return stamp <= end; });
  }
  [[nodiscard]] double over_last(Duration duration) const {
    return median([begin = samples_.back().stamp - duration](Stamp stamp) { return stamp >= begin; });
  }

 private:
  struct Sample {
    Stamp stamp;
    double value;
  };
  template <class Chosen> [[nodiscard]] double median(Chosen chosen) const {
    std::vector<double> values;
    for (const Sample& sample : samples_)
      if (chosen(sample.stamp))
        values.push_back(sample.value);
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
  }

  std::vector<Sample> samples_;
};

/// How far ahead of the VLP-16 of product id 0x21 the wall at its end of the room is, in the returns as they are.
MedianOverTime distance_to_end_wall_m(const std::filesystem::path& file) {
  Expected<Capture, std::string> capture = Capture::open(file);
  Expected<LidarInput, std::string> lidar = LidarInput::open(LidarOptions{}, 0);
  MedianOverTime distance_m;
  while (const Datagram* datagram = capture->next())
    if (const LidarPacket* packet = lidar->receive(*datagram))
      for (const LidarReturn& r : test::returns_of(*packet))
        if (r.x_m > 6.8F && r.x_m < 7.6F && std::abs(r.y_m + 1.0F) < 0.8F)
          distance_m.add(packet->stamp, static_cast<double>(r.x_m));
  return distance_m;
}

/// The truth is 15.45 m/s: the map of the raw points is sharpest at 15.35 to 15.58 m/s, and the car gains speed from
/// one GPS fix to the next (14.82 m/s at second 163.0 of the hour, 15.18 m/s at 164.0), which makes 15.35 to 15.53 m/s
/// while the capture lasts (164.47 to 164.96 s). The fixes alone, 14.6 to 15.4 m/s with their tolerance, are a second
/// old.
TEST_F(RealCapture, CarAtFifteenMetresPerSecond) {
  const Replay car = replay("hdl32e_moving_15mps");
  ASSERT_EQ(car.run().status, 0) << car.run().err;
  EXPECT_EQ(car.summary()["packets"]["total"]["data"], 876);
  EXPECT_EQ(car.summary()["packets"]["total"]["position"], 100);
  const auto trajectory = car.trajectory();
  ASSERT_GE(trajectory.size(), 5U);
  double path_m = 0;
  for (std::size_t i = 2; i < trajectory.size(); ++i)
    path_m += (trajectory[i].T_source_base.translation - trajectory[i - 1].T_source_base.translation).norm();
  const Duration elapsed = trajectory.back().stamp - trajectory[1].stamp;
  EXPECT_NEAR(path_m / to_seconds(elapsed), 15.45, 0.35);
  const Eigen::Quaterniond turn =
      trajectory[1].T_source_base.rotation.conjugate() * trajectory.back().T_source_base.rotation;
  const double yaw_dps = to_rpy_rad(turn).z() / kRadPerDeg / to_seconds(elapsed);
  EXPECT_LT(yaw_dps, 0.0) << "clockwise";
  EXPECT_GT(yaw_dps, -3.0);
}

/// The car pulls away after half a second.
TEST_F(RealCapture, StandingHdl32) {
  const Replay standing = replay("hdl32e_static_monterey");
  ASSERT_EQ(standing.run().status, 0) << standing.run().err;
  EXPECT_EQ(standing.summary()["packets"]["total"]["data"], 2702);
  EXPECT_EQ(standing.summary()["packets"]["total"]["position"], 299);
  EXPECT_NEAR(static_cast<double>(standing.trajectory().size()), 17.6, 1);
  expect_still(standing.trajectory(), milliseconds{500});
}

/// This lidar is moved 0.1 m towards the end wall after one and a half seconds: the wall itself says how far.
TEST_F(RealCapture, Vlp16ThatReportsAnotherModelStandsThenMoves) {
  const Replay vlp16 = replay("vlp16_static_1200rpm_product21");
  ASSERT_EQ(vlp16.run().status, 0) << vlp16.run().err;
  EXPECT_EQ(vlp16.summary()["packets"]["total"]["data"], 1902);
  EXPECT_EQ(vlp16.summary()["packets"]["total"]["position"], 367);
  const std::vector<StampedPose> trajectory = vlp16.trajectory();
  EXPECT_NEAR(static_cast<double>(trajectory.size()), 50.4, 1);
  expect_still(trajectory, milliseconds{1500});

  const MedianOverTime wall_m = distance_to_end_wall_m(capture_file("vlp16_static_1200rpm_product21"));
  MedianOverTime x_m;
  for (const StampedPose& row : trajectory)
    x_m.add(row.stamp, row.T_source_base.translation.x());
  constexpr Duration kWindow = milliseconds{200};
  const double nearer_m = wall_m.over_first(kWindow) - wall_m.over_last(kWindow);
  EXPECT_GT(nearer_m, 0.08);
  EXPECT_NEAR(x_m.over_last(kWindow) - x_m.over_first(kWindow), nearer_m, 0.04);
}

TEST_F(RealCapture, StandingVlp16WithGps) {
  const Replay standing = replay("vlp16_static_gps_pps");
  ASSERT_EQ(standing.run().status, 0) << standing.run().err;
  EXPECT_EQ(standing.summary()["packets"]["total"]["data"], 293);
  EXPECT_EQ(standing.summary()["packets"]["total"]["position"], 57);
  EXPECT_NEAR(static_cast<double>(standing.trajectory().size()), 3.9, 1);
  expect_still(standing.trajectory(), milliseconds{500});
}

/// A ROS 2 bag that names no serialisation. Of its 2193 packets none is missing: each follows the one before by the
/// packet spacing of the sensor.
TEST_F(RealCapture, StandingVls128InABag) {
  const Replay standing({(test_data() / "velodyne/vls128").string()});
  ASSERT_EQ(standing.run().status, 0) << standing.run().err;
  EXPECT_EQ(standing.summary()["packets"]["total"]["data"], 2193);
  EXPECT_GE(standing.trajectory().size(), 3U);
  EXPECT_EQ(standing.summary()["lidars"]["front"]["model"], "VLS-128");
  EXPECT_NEAR(standing.summary()["lidars"]["front"]["rpm"].get<double>(), 600, 10);

  const Replay with_gap({"--fail", "front:lost@0.1-0.2", (test_data() / "velodyne/vls128").string()});
  const nlohmann::json packets = with_gap.summary()["packets"]["front"];
  EXPECT_GT(packets["lost"], 500);
  EXPECT_EQ(packets["data"].get<int>() + packets["lost"].get<int>(), 2193) << "all that was lost is counted";
}

TEST_F(RealCapture, OfOusterAndHesaiAreRefusedByTheirNames) {
  const ProgramRun ouster = Replay({(test_data() / "ouster/OS-1-32-G_v2.1.1_1024x10.pcap").string()}).run();
  EXPECT_EQ(ouster.status, 1);
  EXPECT_NE(ouster.err.find("64 packets look like those of a lidar of Ouster"), std::string::npos) << ouster.err;
  for (const char* const model : {"40p", "qt128", "xt16", "xt32", "xt32m"}) {
    const ProgramRun hesai = Replay({(test_data() / "hesai" / model).string()}).run();
    EXPECT_EQ(hesai.status, 1);
    EXPECT_NE(hesai.err.find("/pandar_packets (pandar_msgs/PandarScan) is of a lidar of Hesai"), std::string::npos)
        << hesai.err;
  }
}

} // namespace
} // namespace locus::test

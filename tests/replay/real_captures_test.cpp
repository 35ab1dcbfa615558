// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "drivers/files/capture.hpp"
#include "drivers/lidar_input.hpp"
#include "replay_run.hpp"
#include "support/returns.hpp"
#include "support/test_data.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;

/// Captures of real sensors, replayed as users do: lidar alone, no configuration.
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

  /// Expects no motion in the poses up to `duration` after the first.
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

/// Median of repeated measurements over the first or last part of a capture.
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

/// Measures the distance from the VLP-16 of product id 0x21 to the wall at its end of the room, from the raw returns.
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

/// The true speed is 15.45 m/s. The map of the raw points is sharpest at 15.35 to 15.58 m/s. The car accelerates
/// between GPS fixes (14.82 m/s at second 163.0 of the hour, 15.18 m/s at 164.0), which extrapolates to 15.35 to 15.53
/// m/s during the capture (164.47 to 164.96 s). The fixes alone, 14.6 to 15.4 m/s with their tolerance, are one second
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

/// The car starts to move after half a second.
TEST_F(RealCapture, StandingHdl32) {
  const Replay standing = replay("hdl32e_static_monterey");
  ASSERT_EQ(standing.run().status, 0) << standing.run().err;
  EXPECT_EQ(standing.summary()["packets"]["total"]["data"], 2702);
  EXPECT_EQ(standing.summary()["packets"]["total"]["position"], 299);
  EXPECT_NEAR(static_cast<double>(standing.trajectory().size()), 17.6, 1);
  expect_still(standing.trajectory(), milliseconds{500});
}

/// This lidar is moved 0.1 m towards the end wall after 1.5 s; the distance to the wall is the reference.
TEST_F(RealCapture, Vlp16ReportingAnotherModelStandsThenMoves) {
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

/// A ROS 2 bag without a serialisation format. None of its 2193 packets is missing: all follow at the sensor's packet
/// spacing.
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
  EXPECT_EQ(packets["data"].get<int>() + packets["lost"].get<int>(), 2193) << "all lost packets are counted";
}

/// No option is needed: only one metadata file beside the capture is of the sensor that sent these packets.
TEST_F(RealCapture, MovingOusterIsReadWithTheMatchingMetadata) {
  const Replay moving({(test_data() / "ouster/OS-1-128_v2.3.0_1024x10_lb_n3.pcap").string()});
  ASSERT_EQ(moving.run().status, 0) << moving.run().err;
  EXPECT_NE(
      moving.run().out.find("OS-1-128_v2.3.0_1024x10.json: the metadata of lidar front, OS1-128 with serial number "
                            "122201000998; its packets go to port 7502"),
      std::string::npos)
      << moving.run().out;
  const nlohmann::json summary = moving.summary();
  EXPECT_EQ(summary["packets"]["front"]["data"], 192);
  EXPECT_EQ(summary["packets"]["front"]["position"], 30);
  EXPECT_EQ(summary["packets"]["front"]["lost"], 0);
  EXPECT_EQ(summary["lidars"]["front"]["model"], "OS1-128");
  EXPECT_NEAR(summary["lidars"]["front"]["rpm"].get<double>(), 600, 5);
  EXPECT_EQ(summary["sources"]["front_imu"]["received"], 30);
  EXPECT_EQ(summary["sources"]["front_imu"]["rejected"]["out_of_order"], 0) << "its clock is that of the columns";
  EXPECT_EQ(moving.trajectory().size(), 3U);
}

/// Three turns of an OS1-128 on a car, with the pose of its sensor frame for each by the maker's own odometry. That
/// odometry does not de-skew the first turns, so a pose is that of the middle of a turn, when the sensor faces forward,
/// as the car does. Its accelerometer measures 3.7 m/s^2, so that other instants would differ by 4 cm. Sweeps that
/// begin in the middle of a turn end there.
TEST_F(RealCapture, MovingOusterMatchesThePosesOfItsMaker) {
  std::vector<Pose> truth;
  std::ifstream kitti{test_data() / "ouster/OS-1-128_v2.3.0_1024x10_lb_n3_poses_kitti.txt"};
  const auto read = [&](double& value) { return static_cast<bool>(kitti >> value); };
  for (std::array<double, 12> rows{}; std::ranges::all_of(rows, read);) {
    const Eigen::Matrix<double, 3, 4> T = Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>{rows.data()};
    truth.push_back({Eigen::Quaterniond{Eigen::Matrix3d{T.leftCols<3>()}}.normalized(), T.col(3)});
  }
  ASSERT_EQ(truth.size(), 3U);
  const Replay moving({"--start", "0.05", (test_data() / "ouster/OS-1-128_v2.3.0_1024x10_lb_n3.pcap").string()});
  ASSERT_EQ(moving.run().status, 0) << moving.run().err;
  const std::vector<StampedPose> middles = moving.trajectory();
  ASSERT_GE(middles.size(), 2U);
  const Pose moved = middles[0].T_source_base.inverse() * middles[1].T_source_base;
  const Pose by_maker = truth[1].inverse() * truth[2];
  EXPECT_LT((moved.translation - by_maker.translation).norm(), 0.02);
  EXPECT_LT(angle_rad(moved.rotation.conjugate() * by_maker.rotation), 0.2 * kRadPerDeg);
}

TEST_F(RealCapture, OustersUseTheMetadataBesideThem) {
  for (const auto& [name, model, mode] :
       {std::tuple{"OS-0-128-U1_v2.3.0_1024x10", "OS0-128", "strongest"},
        std::tuple{"OS-0-32-U1_v2.2.0_1024x10", "OS0-32", "dual"},
        std::tuple{"OS-1-32-G_v2.1.1_1024x10", "OS1-32", "strongest"},
        std::tuple{"OS-1-128_767798045_1024x10_20230712_120049", "OS1-128", "dual"},
        std::tuple{"crc_test", "OS0-128", "strongest"}, std::tuple{"windowed_frame1", "OS0-128", "strongest"}}) {
    const Replay standing({(test_data() / "ouster" / (std::string{name} + ".pcap")).string()});
    if (std::string_view{name}.find("767798045") != std::string_view::npos) { // too short for a sweep
      EXPECT_NE(standing.run().out.find("OS1-128"), std::string::npos) << standing.run().err;
      continue;
    }
    ASSERT_EQ(standing.run().status, 0) << name << standing.run().err;
    EXPECT_EQ(standing.summary()["lidars"]["front"]["model"], model);
    EXPECT_EQ(standing.summary()["lidars"]["front"]["return_mode"], mode);
    EXPECT_EQ(standing.summary()["packets"]["front"]["lost"], 0) << name;
  }
}

TEST_F(RealCapture, OusterWithMetadataOfAnotherIsReported) {
  const std::filesystem::path capture = test_data() / "ouster/OS-1-32-G_v2.1.1_1024x10.pcap";
  for (const auto& [name, reason] :
       {std::pair{"OS-0-32-U1_v2.2.0_1024x10", "length 64"}, {"OS-1-128_v2.3.0_1024x10", "length 64"}}) {
    const std::string metadata = (test_data() / "ouster" / (std::string{name} + ".json")).string();
    const Replay replay({"--set", "lidars.0.metadata=" + metadata, "--set", "lidars.0.port=7502", capture.string()});
    EXPECT_EQ(replay.run().status, 1);
    EXPECT_NE(replay.run().err.find(std::string{"64 datagrams to port 7502 of lidar front, rejected: "} + reason),
              std::string::npos)
        << replay.run().err;
    EXPECT_NE(replay.run().err.find("is " + metadata + " the metadata of this sensor, as it was configured then?"),
              std::string::npos);
  }
}

TEST_F(RealCapture, OusterWithoutMetadataIsNamed) {
  const TemporaryFolder alone;
  std::filesystem::copy_file(test_data() / "ouster/OS-1-32-G_v2.1.1_1024x10.pcap", alone / "drive.pcap");
  const ProgramRun ouster = Replay({(alone / "drive.pcap").string()}).run();
  EXPECT_EQ(ouster.status, 1);
  EXPECT_NE(ouster.err.find("64 packets look like those of a lidar of Ouster"), std::string::npos) << ouster.err;
  EXPECT_NE(ouster.err.find("locusctl fetch SENSOR -o drive.json"), std::string::npos) << ouster.err;
}

/// No configuration.
TEST_F(RealCapture, HesaiModelsInBagsAreIdentified) {
  struct Recorded {
    const char *folder, *model;
    std::uint64_t packets, lost; ///< missing packets by sequence number
  };
  for (const Recorded& recorded :
       {Recorded{"40p", "Pandar40P", 1439, 0}, Recorded{"xt16", "XT16", 1626, 0}, Recorded{"xt32", "XT32", 2000, 0},
        Recorded{"xt32m", "XT32M", 1815, 852}, Recorded{"qt128", "QT128", 1800, 0}}) {
    const Replay replay({(test_data() / "hesai" / recorded.folder).string()});
    ASSERT_EQ(replay.run().status, 0) << replay.run().err;
    const nlohmann::json summary = replay.summary(), packets = summary["packets"]["total"];
    EXPECT_EQ(summary["lidars"]["front"]["model"], recorded.model);
    EXPECT_EQ(summary["lidars"]["front"]["return_mode"], "dual");
    EXPECT_EQ(packets["received"], recorded.packets) << recorded.folder;
    EXPECT_EQ(packets["data"], recorded.packets) << recorded.folder;
    EXPECT_EQ(packets["lost"], recorded.lost) << recorded.folder;
    EXPECT_EQ(summary["sweeps"]["failed"], 0) << recorded.folder;
  }
}

} // namespace
} // namespace locus::test

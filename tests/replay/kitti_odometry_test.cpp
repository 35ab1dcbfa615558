// SPDX-License-Identifier: Apache-2.0
// Sequences in the layout of KITTI's odometry benchmark.
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <numbers>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "replay_run.hpp"
#include "support/errors.hpp"
#include "support/kitti_room.hpp"
#include "support/scenes.hpp"
#include "sweep_folder/sweep_points.hpp"
#include "sweep_folders.hpp"

namespace locus::test {
namespace {

using std::filesystem::path;

/// A drive around the room in the layout of KITTI's odometry benchmark, with de-skewed sweeps.
class KittiOdometry : public testing::Test {
 protected:
  static constexpr int kSweeps = 30;

  static void SetUpTestSuite() {
    data_ = new TemporaryFolder;
    write(data_->path() / "dataset");
  }
  static void TearDownTestSuite() {
    delete data_;
    data_ = nullptr;
  }
  [[nodiscard]] static path data() { return data_->path() / "dataset"; }
  [[nodiscard]] static path sequence() { return data() / "sequences/04"; }

 private:
  static std::string row(const Pose& T) {
    const Eigen::Matrix3d R = T.R();
    std::string text;
    for (Eigen::Index i = 0; i < 3; ++i)
      text += fmt::format("{:e} {:e} {:e} {:e}{}", R(i, 0), R(i, 1), R(i, 2), T.translation[i], i < 2 ? " " : "");
    return text;
  }

  static void write(const path& data) {
    const sim::Trajectory trajectory(sim::room_course(std::chrono::seconds{8}, 1.0), sim::room_start());
    const sim::Scene room = sim::room();
    Eigen::Matrix3d axes; // axes of a forward-looking camera in the lidar frame
    axes << 0, -1, 0, 0, 0, -1, 1, 0, 0;
    const Pose T_camera_lidar{Eigen::Quaterniond(axes), {0.01, -0.07, -0.27}};
    std::string times, poses;
    Pose T_world_first;
    for (int sweep = 0; sweep < kSweeps; ++sweep) {
      const Duration at = sweep * std::chrono::milliseconds{100};
      const Pose T_world_lidar = trajectory.T_world_base(trajectory.start() + std::chrono::seconds{4} + at) *
                                 Pose{Eigen::Quaterniond::Identity(), {0, 0, 1}};
      if (sweep == 0)
        T_world_first = T_world_lidar;
      std::vector<float> numbers;
      for (int ring = 0; ring < kitti_room::kRings; ++ring) {
        for (int column = 0; column < kitti_room::kColumns; ++column) {
          const Eigen::Vector3d ray =
              kitti_room::direction(ring, -2 * std::numbers::pi * column / kitti_room::kColumns);
          const auto hit = room.cast({T_world_lidar.translation, T_world_lidar.rotation * ray}, 100);
          if (!hit)
            continue;
          const Eigen::Vector3f p = (hit->range_m * ray).cast<float>();
          numbers.insert(numbers.end(), {p.x(), p.y(), p.z(), 0.5F});
        }
      }
      write_with_folders(data / fmt::format("sequences/04/velodyne/{:06}.bin", sweep), bytes_of_floats(numbers));
      times += fmt::format("{:e}\n", to_seconds(at));
      poses += row(T_camera_lidar * T_world_first.inverse() * T_world_lidar * T_camera_lidar.inverse()) + "\n";
    }
    write_with_folders(data / "sequences/04/times.txt", times);
    write_with_folders(data / "sequences/04/calib.txt",
                       "P0: 1 0 0 0 0 1 0 0 0 0 1 0\nTr: " + row(T_camera_lidar) + "\n");
    write_with_folders(data / "poses/04.txt", poses);
  }

  static inline TemporaryFolder* data_ = nullptr;
};

TEST_F(KittiOdometry, SequenceIsReplayedAndComparedWithItsPoses) {
  const Replay replay({"--kitti-as-published", sequence()});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_EQ(replay.run().err, "");
  EXPECT_TRUE(contains(replay.run().out, "velodyne is lidar front, the poses of KITTI are the truth; the points of a "
                                         "sweep are treated as of one instant"))
      << replay.run().out;
  const nlohmann::json summary = replay.summary();
  EXPECT_EQ(summary["sweeps"]["seen"], kSweeps);
  EXPECT_EQ(summary["lidars"]["front"]["clouds"]["rings"], "field");
  EXPECT_EQ(summary["lidars"]["front"]["clouds"]["times"], "instant");
  EXPECT_EQ(summary["kitti_vertical_angle_added_deg"], 0);
  EXPECT_LT(summary["ape_m"]["max"], 0.02);
  const std::vector<StampedPose> trajectory = replay.trajectory();
  ASSERT_EQ(trajectory.size(), static_cast<std::size_t>(kSweeps));
  EXPECT_NEAR(to_seconds(trajectory.back().stamp.time_since_epoch()), 0.1 * (kSweeps - 1), 1e-5) << "its own times";
}

TEST_F(KittiOdometry, AnglesAreCorrectedAsInRawData) {
  const Replay replay({sequence()});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_EQ(replay.summary()["kitti_vertical_angle_added_deg"], 0.205);
  EXPECT_TRUE(contains(replay.run().out, "0.205 degrees are added")) << replay.run().out;
}

/// Elevation of a point that is read as a field x, y, z.
double elevation_deg(const tools::SweepPoints& points, std::size_t i) {
  std::array<float, 3> xyz{};
  std::memcpy(xyz.data(), points.data.data() + i * points.point_step, sizeof(xyz));
  const Eigen::Vector3d p = Eigen::Vector3f(xyz.data()).cast<double>();
  return std::atan2(p.z(), p.head<2>().norm()) * 180.0 / std::numbers::pi;
}

TEST_F(KittiOdometry, EachPointIsRaisedByTheAngle) {
  tools::SweepPoints published, raised;
  const path file = sequence() / "velodyne/000000.bin";
  ASSERT_EQ(tools::read_kitti_sweep(file, 0.0, published), std::nullopt);
  ASSERT_EQ(tools::read_kitti_sweep(file, 0.205, raised), std::nullopt);
  ASSERT_GT(published.width, 1000U);
  ASSERT_EQ(raised.width, published.width);
  for (std::size_t i = 0; i < published.width; ++i)
    ASSERT_NEAR(elevation_deg(raised, i) - elevation_deg(published, i), 0.205, 1e-3) << i;
}

TEST_F(KittiOdometry, FolderAboveResolvesToTheOnlySequence) {
  const std::string expected = read_text(Replay({sequence()}).file("odometry.tum"));
  for (const path& above : {data(), data() / "sequences"}) {
    const Replay replay({above});
    EXPECT_EQ(read_text(replay.file("odometry.tum")), expected);
    EXPECT_TRUE(
        contains(replay.run().out, above.string() + ": the only recording in it is used, " + sequence().string()))
        << replay.run().out;
  }
}

TEST_F(KittiOdometry, SeveralSequencesAreListed) {
  const TemporaryFolder folder;
  for (int i = 0; i < 5; ++i)
    write_with_folders(folder / fmt::format("sequences/{:02}/velodyne/000000.bin", i), std::string(16, '\0'));
  expect_refused(folder.path(),
                 {"contains 5 recordings", "name one of them: ", "sequences/00", "sequences/02 and 2 more"});
}

TEST_F(KittiOdometry, BadPosesAndCalibrationAreNamed) {
  const TemporaryFolder folder;
  const path copy = folder / "dataset";
  std::filesystem::copy(data(), copy, std::filesystem::copy_options::recursive);
  const std::string poses = read_text(copy / "poses/04.txt");
  write_with_folders(copy / "poses/04.txt", poses.substr(0, poses.size() / 2) + "\n");
  expect_refused(copy / "sequences/04", {"poses/04.txt"});
  write_with_folders(copy / "poses/04.txt", poses + lines_of(poses).back() + "\n");
  expect_refused(copy / "sequences/04", {"poses/04.txt", fmt::format("other than {} poses", kSweeps)});
  write_with_folders(copy / "poses/04.txt", poses);
  write_with_folders(copy / "sequences/04/calib.txt", "P0: 1 0 0 0 0 1 0 0 0 0 1 0\n");
  expect_refused(copy / "sequences/04", {"calib.txt", "Tr:"});
  std::filesystem::remove(copy / "poses/04.txt");
  EXPECT_EQ(Replay({copy / "sequences/04"}).run().status, 0) << "sequences 11 to 21 have no poses";
}

} // namespace
} // namespace locus::test

// SPDX-License-Identifier: Apache-2.0
// Output of --sweeps for a drive with known scene and trajectory.
#include <algorithm>
#include <cstring>
#include <fstream>
#include <sstream>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "daemon/dds/ros_messages.hpp"
#include "replay_run.hpp"
#include "support/clouds.hpp"
#include "support/errors.hpp"
#include "support/scenes.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

using std::filesystem::path;
using Point = daemon::CloudMessage::Point;

path sweep_file(const path& folder, std::size_t number, const std::string& extension = "pcd") {
  return folder / fmt::format("{:06}.{}", number, extension);
}

/// Reads the points after a header that ends with this line.
std::vector<Point> points_of(const path& file, const std::string& last_line = "DATA binary\n") {
  const std::string bytes = read_text(file);
  const std::size_t begin = bytes.find(last_line);
  EXPECT_NE(begin, std::string::npos) << file;
  if (begin == std::string::npos)
    return {};
  const std::size_t length = bytes.size() - begin - last_line.size();
  EXPECT_EQ(length % sizeof(Point), 0U);
  std::vector<Point> points(length / sizeof(Point));
  if (!points.empty())
    std::memcpy(points.data(), bytes.data() + begin + last_line.size(), points.size() * sizeof(Point));
  return points;
}

std::vector<Stamp> stamps_of(const path& folder) {
  std::vector<Stamp> stamps;
  for (const std::string& line : lines_of(read_text(folder / "times.txt"))) {
    const std::size_t dot = line.find('.');
    EXPECT_EQ(line.size(), dot + 10) << "nanoseconds: " << line;
    stamps.push_back(stamp_from_ns(std::stoll(line.substr(0, dot) + line.substr(dot + 1))));
  }
  return stamps;
}

/// One run on the drive around the room, with --sweeps.
struct SweepsOfRoom {
  explicit SweepsOfRoom(std::vector<std::string> arguments = {}) : replay(with(std::move(arguments))) {
    EXPECT_EQ(replay.run().status, 0) << replay.run().err;
  }

  TemporaryFolder folder;
  path sweeps = folder / "sweeps";
  Replay replay;

 private:
  [[nodiscard]] std::vector<std::string> with(std::vector<std::string> arguments) const {
    arguments.insert(arguments.end(), {"--sweeps", sweeps, room_drive()});
    return arguments;
  }
};

/// True trajectory of the drive.
const sim::Trajectory& trajectory() {
  static const sim::Trajectory trajectory(sim::room_course(std::chrono::seconds{8}, 1.0), sim::room_start());
  return trajectory;
}

bool turns_fast(Stamp stamp) { return std::abs(trajectory().at(stamp).angular_velocity_base_radps.z()) > 1.0; }

/// Counts the points that are farther than `far_m` from every surface of the room.
class FarOff {
 public:
  explicit FarOff(double far_m) : far_m_(far_m) {}

  void take(Stamp seen_from, const Eigen::Vector3d& p_base) {
    far_ += room_.distance_to_surface(trajectory().T_world_base(seen_from) * p_base) > far_m_ ? 1U : 0U;
    ++all_;
  }
  [[nodiscard]] double share() const {
    EXPECT_GT(all_, 10'000U);
    return static_cast<double>(far_) / static_cast<double>(all_);
  }

 private:
  double far_m_;
  sim::Scene room_ = sim::room();
  std::size_t far_ = 0, all_ = 0;
};

/// Fraction of points of fast turns that are off the surfaces, transformed by the true pose at their sweep's stamp.
double share_far_off(const path& sweeps, double far_m) {
  const std::vector<Stamp> stamps = stamps_of(sweeps);
  FarOff far(far_m);
  for (std::size_t i = 2; i < stamps.size(); ++i) { // the wheels have not delivered two samples yet
    if (!turns_fast(stamps[i]))
      continue;
    const std::vector<Point> points = points_of(sweep_file(sweeps, i));
    for (std::size_t k = 0; k < points.size(); k += 7) // a sample is enough
      far.take(stamps[i], Eigen::Vector3f{points[k].x_m, points[k].y_m, points[k].z_m}.cast<double>());
  }
  return far.share();
}

/// Same for the raw returns, without de-skew.
double share_far_off_as_measured(double far_m) {
  FarOff far(far_m);
  const Eigen::Vector3d mounted{0.3, 0, 0.75};
  for (const CloudTurn& turn : turns_of(room_drive() / "lidar.pcap")) {
    for (std::size_t k = 0; turns_fast(turn.end()) && k < turn.points.size(); k += 7)
      far.take(turn.end(), turn.points[k].p_m.cast<double>() + mounted);
  }
  return far.share();
}

/// Range noise is 1 cm (sigma); gyro and wheels contribute less than 1 mm in 0.1 s. At 2 rad/s the skew of walls three
/// metres away is up to 0.6 m, that of the floor is zero.
TEST(Sweeps, DeskewedPointsLieOnTheWallsInATurn) {
  constexpr double kFar_m = 0.04;
  EXPECT_LT(share_far_off(SweepsOfRoom().sweeps, kFar_m), 0.01);
  EXPECT_GT(share_far_off_as_measured(kFar_m), 0.2);
}

/// Lidar alone: without motion sources the odometry itself de-skews.
TEST(Sweeps, AreDeskewedByTheOdometryWithoutMotionSources) {
  EXPECT_LT(share_far_off(SweepsOfRoom({"--set", "motion_sources=[]"}).sweeps, 0.1), 0.02);
}

TEST(Sweeps, EachReturnHasTimeRingAndIntensityAndEachSweepStampAndPose) {
  const SweepsOfRoom run;
  const nlohmann::json summary = run.replay.summary();
  const std::vector<StampedPose> estimates = run.replay.trajectory();
  const std::vector<Stamp> stamps = stamps_of(run.sweeps);
  const std::vector<std::string> poses = lines_of(read_text(run.sweeps / "poses.txt"));
  ASSERT_EQ(stamps.size(), estimates.size());
  ASSERT_EQ(poses.size(), estimates.size());
  EXPECT_FALSE(std::filesystem::exists(sweep_file(run.sweeps, stamps.size())));
  std::size_t returns = 0;
  for (std::size_t i = 0; i < stamps.size(); ++i) {
    EXPECT_LT(std::abs(to_seconds(stamps[i] - estimates[i].stamp)), 1e-6);
    std::istringstream numbers{poses[i]};
    Eigen::Matrix<double, 3, 4, Eigen::RowMajor> T;
    for (double& number : T.reshaped<Eigen::RowMajor>())
      ASSERT_TRUE(numbers >> number);
    EXPECT_LT((T.col(3) - estimates[i].T_source_base.translation).norm(), 1e-5);
    EXPECT_LT((T.leftCols<3>() - estimates[i].T_source_base.R()).norm(), 1e-5);
    const std::vector<Point> points = points_of(sweep_file(run.sweeps, i));
    returns += points.size();
    std::array<int, 16> of_ring{};
    for (const Point& p : points) {
      ASSERT_LE(p.time_s, 0.0F);
      ASSERT_GE(p.time_s, -0.11F);
      ASSERT_LT(p.ring, 16);
      ASSERT_EQ(p.lidar, 0);
      ASSERT_LE(p.intensity, 255.0F);
      ++of_ring[p.ring];
    }
    EXPECT_TRUE(std::ranges::none_of(of_ring, [](int count) { return count == 0; }));
  }
  EXPECT_NEAR(static_cast<double>(returns) / static_cast<double>(stamps.size()), summary["points"]["raw_mean"], 1)
      << "all returns of the room are within reach";
}

TEST(Sweeps, EveryFormatHasTheSamePointsAndDoesNotChangeTheOdometry) {
  const SweepsOfRoom pcd({"--duration", "2"}), ply({"--duration", "2", "--sweeps-format", "ply"}),
      bin({"--duration", "2", "--sweeps-format", "bin"});
  const Replay without({"--duration", "2", room_drive()});
  EXPECT_EQ(read_text(pcd.replay.file("odometry.csv")), read_text(without.file("odometry.csv")));
  const std::size_t sweeps = stamps_of(pcd.sweeps).size();
  EXPECT_GT(sweeps, 15U);
  for (std::size_t i = 0; i < sweeps; ++i) {
    const std::vector<Point> points = points_of(sweep_file(pcd.sweeps, i));
    const std::vector<Point> in_ply = points_of(sweep_file(ply.sweeps, i, "ply"), "end_header\n");
    const std::string in_bin = read_text(sweep_file(bin.sweeps, i, "bin"));
    ASSERT_EQ(in_ply.size(), points.size());
    EXPECT_EQ(std::memcmp(points.data(), in_ply.data(), points.size() * sizeof(Point)), 0);
    ASSERT_EQ(in_bin.size(), points.size() * 4 * sizeof(float));
    for (std::size_t k = 0; k < points.size(); ++k) {
      std::array<float, 4> numbers;
      std::memcpy(numbers.data(), in_bin.data() + k * sizeof(numbers), sizeof(numbers));
      ASSERT_EQ(numbers, (std::array{points[k].x_m, points[k].y_m, points[k].z_m, points[k].intensity / 255.0F}));
    }
  }
}

TEST(Sweeps, SameBitsWithOneAndTwoThreads) {
  const SweepsOfRoom one({"--threads", "1", "--duration", "3"}), two({"--threads", "2", "--duration", "3"});
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(one.sweeps)) {
    EXPECT_EQ(read_text(entry.path()), read_text(two.sweeps / entry.path().filename())) << entry.path();
    ++files;
  }
  EXPECT_GT(files, 25U);
}

/// Filters affect registration but not the output; range limits and the self filter affect both.
TEST(Sweeps, OnlyRangeLimitsRemovePoints) {
  const SweepsOfRoom all({"--duration", "1"}),
      voxels({"--duration", "1", "--set", "segment_filter.enabled=false", "--set", "voxel_filter.enabled=true"}),
      near({"--duration", "1", "--set", "range_m=[0.5, 3]"});
  const std::size_t count = points_of(sweep_file(all.sweeps, 5)).size();
  EXPECT_EQ(points_of(sweep_file(voxels.sweeps, 5)).size(), count);
  const std::vector<Point> few = points_of(sweep_file(near.sweeps, 5));
  EXPECT_LT(few.size(), count);
  EXPECT_FALSE(few.empty());
}

TEST(SweepsOption, NonEmptyFolderAndUnknownFormatAreErrors) {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder / "used");
  std::ofstream{folder / "used/thesis.txt"} << "precious";
  std::ofstream{folder / "file"} << "precious";
  std::filesystem::create_directories(folder / "drive");
  std::filesystem::copy_file(room_drive() / "lidar.pcap", folder / "drive/lidar.pcap");
  const auto expect_refusal = [&](const std::vector<std::string>& more, const std::string& said, int status = 2) {
    std::vector<std::string> arguments{"-o", folder / "out", "--duration", "1", folder / "drive"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProgramRun run = run_program(LOCUS_REPLAY, arguments);
    EXPECT_EQ(run.status, status) << run.err;
    EXPECT_TRUE(contains(run.err, said)) << run.err;
    EXPECT_FALSE(std::filesystem::exists(folder / "out/map.pcd"));
  };
  expect_refusal({"--sweeps", folder / "used"}, "exists and is not empty");
  expect_refusal({"--sweeps", folder / "file"}, "exists and is not empty");
  expect_refusal({"--sweeps", folder / "out/"}, "is the folder of the results");
  expect_refusal({"--sweeps", folder / "drive/sweeps"}, "the recording that is read");
  expect_refusal({"--sweeps", "/proc/sweeps"}, "choose another with --sweeps", 1);
  expect_refusal({"--sweeps", folder / "a", "--sweeps-format", "las"}, "las");
  expect_refusal({"--sweeps-format", "ply"}, "--sweeps");
  expect_refusal({"--sweeps", folder / "a", "--realtime"}, "--realtime");
  EXPECT_EQ(read_text(folder / "used/thesis.txt"), "precious");
}

/// Simulates a full disk: limits the file size to 100 blocks of 512 bytes or 1 kB.
TEST(SweepsOption, UnwritableSweepEndsTheRun) {
  const TemporaryFolder folder;
  const ProgramRun run =
      run_program("/bin/sh", {"-c", fmt::format("trap '' XFSZ; ulimit -f 100; exec {} -o {} --sweeps {} {}",
                                                LOCUS_REPLAY, (folder / "out").string(), (folder / "sweeps").string(),
                                                (room_drive() / "lidar.pcap").string())});
  EXPECT_EQ(run.status, 1);
  EXPECT_TRUE(contains(run.err, "000000.pcd: cannot be written (File too large)")) << run.err;
  EXPECT_LT(lines_of(read_text(folder / "out/odometry.csv")).size(), 5U) << "reported before the end of the run";
}

} // namespace
} // namespace locus::test

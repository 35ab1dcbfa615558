// SPDX-License-Identifier: Apache-2.0
#include "drivers/files/motion_files.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <fstream>
#include <random>
#include <thread>

#include <gtest/gtest.h>
#include <sys/stat.h>

#include "drivers/files/capture_folder.hpp"
#include "support/errors.hpp"
#include "support/temporary_file.hpp"
#include "support/temporary_folder.hpp"

namespace locus {
namespace {

using test::bytes_of;
using test::TemporaryFile;

template <class Sample> Expected<std::vector<Sample>, std::string> read(const std::filesystem::path& file) {
  auto samples = MotionSamples<Sample>::open(file);
  if (!samples)
    return samples.error();
  return samples->drain();
}

Expected<std::vector<ImuSample>, std::string> imu_from(const std::string& text) {
  const TemporaryFile file{"imu.csv", bytes_of(text)};
  return read<ImuSample>(file.path());
}

Expected<std::vector<OdometrySample>, std::string> odometry_from(const std::string& text) {
  const TemporaryFile file{"wio.tum", bytes_of(text)};
  return read<OdometrySample>(file.path());
}

/// Reads the odometry `text` with the meta file `meta`.
Expected<std::vector<OdometrySample>, std::string> odometry_from(const std::string& text, const std::string& meta) {
  const TemporaryFile file{"wio.tum", bytes_of(text)};
  const TemporaryFile meta_file{"wio.meta.csv", bytes_of(meta)};
  return read<OdometrySample>(file.path());
}

TEST(MotionFiles, ImuRowsHoldRatesForcesAndWhereGivenAttitude) {
  const auto samples = imu_from("t_ns,wx,wy,wz,ax,ay,az,qw,qx,qy,qz\n"
                                "1403636579763555527,0.1,-0.2,+0.3,1,2,9.81\n"
                                "1403636579763555528, 0.1, 0.2, 0.3, 1, 2, 9.81, 0, 1, 0, 0\n"
                                "1403636579763555529,0.1,0.2,0.3,1,2,9.81,0,0,0,0\n");
  ASSERT_TRUE(samples) << samples.error();
  ASSERT_EQ(samples->size(), 3u);
  const ImuSample& first = (*samples)[0];
  EXPECT_EQ(to_ns(first.stamp), 1403636579763555527);
  EXPECT_EQ(first.arrival, first.stamp);
  EXPECT_EQ(first.angular_velocity_radps, Eigen::Vector3d(0.1, -0.2, 0.3));
  EXPECT_EQ(first.specific_force_mps2, Eigen::Vector3d(1, 2, 9.81));
  EXPECT_FALSE(first.attitude);
  ASSERT_TRUE((*samples)[1].attitude);
  EXPECT_EQ((*samples)[1].attitude->x(), 1.0);
  EXPECT_FALSE((*samples)[2].attitude);
}

TEST(MotionFiles, OdometryRowsHoldPosesWithTheRotationsRealPartLast) {
  const auto samples = odometry_from("10.5 1 2 3 0 0 0.6 0.8\n");
  ASSERT_TRUE(samples) << samples.error();
  ASSERT_EQ(samples->size(), 1u);
  EXPECT_EQ((*samples)[0].T_source_base.translation, Eigen::Vector3d(1, 2, 3));
  EXPECT_DOUBLE_EQ((*samples)[0].T_source_base.rotation.w(), 0.8);
  EXPECT_DOUBLE_EQ((*samples)[0].T_source_base.rotation.z(), 0.6);
  EXPECT_EQ((*samples)[0].covariance_scale, 1.0);
}

TEST(MotionFiles, TumTimesRetainNanoseconds) {
  constexpr auto kCases = std::to_array<std::pair<const char*, std::int64_t>>({
      {"1403636579.763555527", 1403636579763555527},
      {"1.403636579763555527e+09", 1403636579763555527}, // format of NumPy and evo
      {"1403636579763555527E-9", 1403636579763555527},
      {"1403636579.7635555274", 1403636579763555527},
      {"1403636579.7635555275", 1403636579763555528},
      {"0.9999999996", 1'000'000'000},
      {"1403636579", 1403636579000000000},
      {"1403636579.", 1403636579000000000},
      {".5", 500'000'000},
      {"-1.25", -1'250'000'000},
      {"0.000000001", 1},
      {"0.0000000001", 0},
      {"0e-18", 0},
      {"00000000000000000000012.5", 12'500'000'000},
  });
  for (const auto& [text, ns] : kCases) {
    const auto samples = odometry_from(std::string{text} + " 0 0 0 0 0 0 1");
    ASSERT_TRUE(samples) << samples.error();
    EXPECT_EQ(to_ns(samples->front().stamp), ns) << text;
  }
}

TEST(MotionFiles, InvalidTimesAreErrors) {
  for (const char* text :
       {"nan", "inf", "-", ".", "1.2.3", "1e", "1e99", "e5", "0x10", "9999999999999", "1,5", "12:30:00"}) {
    EXPECT_TRUE(contains(error_of(odometry_from("1 0 0 0 0 0 0 1\n" + std::string{text} + " 0 0 0 0 0 0 1\n")),
                         "wio.tum:2: time \"" + std::string{text} + "\" is not"))
        << text;
  }
  for (const char* text : {"1.5", "1e9", "nan", "-", "9223372036854775807", "99999999999999999999"}) {
    EXPECT_TRUE(contains(error_of(imu_from("1,0,0,0,0,0,0\n" + std::string{text} + ",0,0,0,0,0,0\n")),
                         "imu.csv:2: time \"" + std::string{text} + "\" is not"))
        << text;
  }
}

TEST(MotionFiles, TimesOutOfRangeAreErrors) {
  EXPECT_TRUE(imu_from("-599999999999999999,0,0,0,0,0,0\n3999999999999999999,0,0,0,0,0,0\n"));
  for (const char* text : {"-600000000000000000", "4000000000000000000"})
    EXPECT_TRUE(contains(error_of(imu_from(std::string{text} + ",0,0,0,0,0,0\n")), "imu.csv:1: time ")) << text;
}

TEST(MotionFiles, CommentsBlankLinesCrlfAndAMissingLastNewlineAreAccepted) {
  const auto imu = imu_from("#timestamp [ns],w_x\r\n\r\n1,0,0,0,0,0,9.81\r\n# interlude\r\n  \t\r\n2,0,0,0,0,0,9.81");
  ASSERT_TRUE(imu) << imu.error();
  EXPECT_EQ(imu->size(), 2u);
  const auto odometry = odometry_from("# t x y z qx qy qz qw\r\n  1\t0  0 0 0 0 0 1 \r\n\r\n2 0 0 0 0 0 0 1");
  ASSERT_TRUE(odometry) << odometry.error();
  EXPECT_EQ(odometry->size(), 2u);
}

TEST(MotionFiles, EmptyFilesHoldNoSamples) {
  EXPECT_TRUE(imu_from("")->empty());
  EXPECT_TRUE(imu_from("t_ns,wx,wy,wz,ax,ay,az\n")->empty());
  EXPECT_TRUE(odometry_from("# nothing\n")->empty());
}

TEST(MotionFiles, NanIsPassedOnForHealthToJudge) {
  const auto imu = imu_from("1,nan,0,0,0,0,NaN\n");
  ASSERT_TRUE(imu) << imu.error();
  EXPECT_TRUE(std::isnan(imu->front().angular_velocity_radps.x()));
  const auto odometry = odometry_from("1 nan nan nan nan nan nan nan\n");
  ASSERT_TRUE(odometry) << odometry.error();
  EXPECT_FALSE(odometry->front().T_source_base.finite());
}

TEST(MotionFiles, MalformedTextIsAnErrorWithFileLineAndRemedy) {
  EXPECT_TRUE(contains(error_of(imu_from("1,0,0,0,0,0,0\n2,0,0\n")), "imu.csv:2: 3 columns; expected t_ns,"));
  EXPECT_TRUE(contains(error_of(imu_from("1,0,0,0,0,0,0,0,0,0,0,0,0,0\n")), "imu.csv:1: too many columns; expected"));
  EXPECT_TRUE(contains(error_of(imu_from("1,0,0,0,0,0,0\n2,0,0,o,0,0,0\n")), "imu.csv:2: a value is not a number"));
  EXPECT_TRUE(contains(error_of(imu_from("1,0,0,0,0,0,\n")), "imu.csv:1: a value is not a number"));
  EXPECT_TRUE(contains(error_of(imu_from("1,0,0,0,0,0,0,9,9,9,9\n")), "imu.csv:1: the attitude is not a unit"));
  EXPECT_TRUE(contains(error_of(imu_from("one,header\nand,another\n")), "imu.csv:2: 2 columns"));
  EXPECT_TRUE(contains(error_of(odometry_from("1 0 0 0 0 0 0\n")), "wio.tum:1: 7 columns; expected t x y z"));
  EXPECT_TRUE(contains(error_of(odometry_from("1 0 0 0 0 0 0 1 \n2 0 0 0 0 0 0 1x\n")), "wio.tum:2: a value is not"));
  EXPECT_TRUE(contains(error_of(odometry_from("1 0 0 0 0 0 0 0\n")), "wio.tum:1: the rotation is not a unit"));
  EXPECT_TRUE(contains(error_of(read<ImuSample>("/no/such/imu.csv")), "/no/such/imu.csv: cannot be read; check"));
  EXPECT_TRUE(contains(error_of(read<ImuSample>(testing::TempDir())), "cannot be read"));
}

TEST(MotionFiles, MetaFileGivesArrivalAndCovarianceAndItsArrivalTheOrder) {
  const auto samples = odometry_from("1.0 1 0 0 0 0 0 1\n1.1 2 0 0 0 0 0 1\n1.2 3 0 0 0 0 0 1\n",
                                     "t_ns,arrival_ns,covariance_scale\n"
                                     "1000000000,1250000000,1\n1100000400,1100000500,7.5\n");
  ASSERT_TRUE(samples) << samples.error();
  ASSERT_EQ(samples->size(), 3u);
  EXPECT_EQ((*samples)[0].T_source_base.translation.x(), 2.0);
  EXPECT_EQ((*samples)[0].covariance_scale, 7.5);
  EXPECT_EQ(to_ns((*samples)[0].arrival), 1100000500);
  EXPECT_EQ(to_ns((*samples)[0].stamp), 1100000000);
  EXPECT_EQ((*samples)[1].T_source_base.translation.x(), 3.0); // no meta row: arrival = stamp
  EXPECT_EQ((*samples)[2].T_source_base.translation.x(), 1.0);
  EXPECT_EQ(to_ns((*samples)[2].arrival), 1250000000);
}

TEST(MotionFiles, RepeatedStampsUseTheirMetaRowsInOrder) {
  const auto samples =
      odometry_from("1.0 1 0 0 0 0 0 1\n1.0 2 0 0 0 0 0 1\n", "1000000000,1100000000,1\n1000000000,1200000000,2\n");
  ASSERT_TRUE(samples) << samples.error();
  EXPECT_EQ(to_ns((*samples)[0].arrival), 1100000000);
  EXPECT_EQ(to_ns((*samples)[1].arrival), 1200000000);
  EXPECT_EQ((*samples)[1].T_source_base.translation.x(), 2.0);
}

TEST(MotionFiles, MetaRowsWithoutSampleOrMalformedAreErrors) {
  const std::string sample = "1.0 1 0 0 0 0 0 1\n";
  EXPECT_TRUE(contains(error_of(odometry_from(sample, "2000000000,2000000000,1\n")),
                       "wio.meta.csv: no sample at t_ns 2000000000"));
  EXPECT_TRUE(
      contains(error_of(odometry_from(sample, "1000000000,1000000000,1\n1000000000,1000000000,1\n")), "no sample"));
  EXPECT_TRUE(contains(error_of(odometry_from(sample, "1000000000,1000000000\n")), "wio.meta.csv:1: expected t_ns,"));
  EXPECT_TRUE(contains(error_of(odometry_from(sample, "1000000000,later,1\n")), "wio.meta.csv:1: expected t_ns,"));
}

TEST(MotionFiles, AnHourOfImuIsReadInSeconds) {
  std::string text;
  for (int i = 0; i < 720'000; ++i) {
    text += std::to_string(1'700'000'000'000'000'000 + i * 5'000'000LL) +
            ",0.012345678,-0.0234567891,0.1234567891,0.0987654321,-0.1987654321,9.8123456789\n";
  }
  const TemporaryFile file{"imu.csv", bytes_of(text)};
  const auto begin = std::chrono::steady_clock::now();
  const auto samples = read<ImuSample>(file.path());
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
  ASSERT_TRUE(samples) << samples.error();
  EXPECT_EQ(samples->size(), 720'000u);
  RecordProperty("seconds", std::to_string(elapsed.count()));
  EXPECT_LT(elapsed.count(), 20.0); // 0.3 s when optimised and alone; sanitizers and other load slow it down
}

class CaptureFolders : public testing::Test {
 public:
  CaptureFolders() { std::filesystem::create_directory(folder_); }
  ~CaptureFolders() override { std::filesystem::remove_all(folder_); }
  void add(const std::string& name) const { std::ofstream{folder_ / name} << "x"; }

  const std::filesystem::path folder_ =
      std::filesystem::path(testing::TempDir()) / ("capture_folder_" + std::to_string(::getpid()));
};

TEST_F(CaptureFolders, FilesOfTheContractAreFoundByName) {
  for (const char* name : {"lidar.pcap", "imu.csv", "imu.meta.csv", "wio.tum", "vio.tum", "vio.meta.csv", "kio.tum",
                           "gt.tum", "gt_map.ply", "config.yaml", "notes.txt"}) {
    add(name);
  }
  const auto found = CaptureFolder::find(folder_);
  ASSERT_TRUE(found) << found.error();
  EXPECT_EQ(found->lidar, std::vector{folder_ / "lidar.pcap"});
  EXPECT_EQ(found->imu, std::vector{folder_ / "imu.csv"});
  EXPECT_EQ(found->ground_truth, folder_ / "gt.tum");
  EXPECT_EQ(found->map_truth, folder_ / "gt_map.ply");
  EXPECT_EQ(found->config, std::vector{folder_ / "config.yaml"});
  ASSERT_EQ(found->odometry.size(), 3u);
  EXPECT_EQ(found->odometry[0].name, "kio");
  EXPECT_EQ(found->odometry[1].name, "vio");
  EXPECT_EQ(found->odometry[2].name, "wio");
  EXPECT_EQ(found->odometry[2].files, std::vector{folder_ / "wio.tum"});
}

TEST_F(CaptureFolders, OnlyTheCaptureMustBeThere) {
  EXPECT_TRUE(contains(error_of(CaptureFolder::find(folder_)), "holds no lidar.pcap or lidar.pcapng"));
  add("lidar.pcapng");
  const auto found = CaptureFolder::find(folder_);
  ASSERT_TRUE(found) << found.error();
  EXPECT_EQ(found->lidar, std::vector{folder_ / "lidar.pcapng"});
  EXPECT_TRUE(found->imu.empty());
  EXPECT_TRUE(found->config.empty());
  EXPECT_TRUE(found->odometry.empty());
  add("lidar.pcap");
  EXPECT_TRUE(contains(error_of(CaptureFolder::find(folder_)), "holds both lidar.pcap and lidar.pcapng"));
}

TEST_F(CaptureFolders, SingleFileIsTheCapture) {
  add("drive.pcap");
  const auto found = CaptureFolder::find(folder_ / "drive.pcap");
  ASSERT_TRUE(found) << found.error();
  EXPECT_EQ(found->lidar, std::vector{folder_ / "drive.pcap"});
}

TEST_F(CaptureFolders, PartsFollowTheNamedCapture) {
  for (const char* const name : {"drive.pcap", "drive.pcap1", "drive.pcap2.gz", "drive.pcap4", "drive.pcapng", "drive",
                                 "drive1", "lidar.pcap.xz", "lidar.pcap1.xz", "a.pcap0", "a.pcap1"})
    add(name);
  const auto found = [&](const char* name) {
    std::vector<std::string> names;
    const auto recording = CaptureFolder::find(folder_ / name);
    for (const auto& file : recording->lidar)
      names.push_back(file.filename());
    return names;
  };
  using Names = std::vector<std::string>;
  EXPECT_EQ(found("drive.pcap"), (Names{"drive.pcap", "drive.pcap1", "drive.pcap2.gz"})) << "the next is missing";
  EXPECT_EQ(found("drive.pcap1"), Names{"drive.pcap1"});
  EXPECT_EQ(found("drive.pcapng"), Names{"drive.pcapng"});
  EXPECT_EQ(found("drive"), Names{"drive"});
  EXPECT_EQ(found("a.pcap0"), Names{"a.pcap0"});
  EXPECT_EQ(found(""), (Names{"lidar.pcap.xz", "lidar.pcap1.xz"})) << "those of the folder";
  EXPECT_EQ(CaptureFolder::find("-")->lidar, std::vector<std::filesystem::path>{"-"});
}

TEST_F(CaptureFolders, PiecesAreOneRecordingInTheOrderOfTheirNumbers) {
  for (const char* piece : {"000001_2026-11-22T08-12-05Z/000009", "000001_2026-11-22T08-12-05Z/000010",
                            "000002_2026-11-22T09-00-00Z/000001", "000002_2026-11-22T09-00-00Z/000002", "notes"})
    std::filesystem::create_directories(folder_ / piece);
  const auto run = [&](const char* name) { return folder_ / name; };
  const std::string first = "000001_2026-11-22T08-12-05Z", second = "000002_2026-11-22T09-00-00Z";
  for (const std::string& piece : {first + "/000009", first + "/000010", second + "/000001", std::string{"notes"}}) {
    add(piece + "/lidar.pcap");
    add(piece + "/config.yaml");
  }
  add(first + "/000009/wio.tum");
  add(second + "/000001/wio.tum");
  add(second + "/000001/vio.tum");
  const auto found = CaptureFolder::find(folder_);
  ASSERT_TRUE(found) << found.error();
  EXPECT_EQ(found->lidar, (std::vector{folder_ / first / "000009/lidar.pcap", folder_ / first / "000010/lidar.pcap",
                                       folder_ / second / "000001/lidar.pcap"}))
      << "and the last piece had just been begun";
  ASSERT_EQ(found->odometry.size(), 2U);
  EXPECT_EQ(found->odometry[0].files,
            (std::vector{folder_ / first / "000009/wio.tum", folder_ / second / "000001/wio.tum"}));
  EXPECT_EQ(found->first_config(), folder_ / first / "000009/config.yaml");
  EXPECT_FALSE(found->changed_config());
  EXPECT_EQ(CaptureFolder::find(run(first.c_str()))->lidar.size(), 2U);
  EXPECT_EQ(CaptureFolder::find(folder_ / second / "000001")->lidar.size(), 1U);
  std::ofstream{folder_ / second / "000001/config.yaml"} << "changed";
  EXPECT_TRUE(contains(CaptureFolder::find(folder_)->changed_config().value_or(""),
                       second + "/000001/config.yaml: differs from "));
  add(second + "/000001/kio.meta.csv");
  EXPECT_TRUE(contains(error_of(CaptureFolder::find(folder_)), "kio.meta.csv: belongs to no source"));
}

TEST_F(CaptureFolders, SilentlyIgnoredFilesAreErrors) {
  EXPECT_TRUE(contains(error_of(CaptureFolder::find(folder_ / "nothing")), "no such file or folder"));
  add("lidar.pcap");
  add("wio.meta.csv");
  EXPECT_TRUE(contains(error_of(CaptureFolder::find(folder_)), "wio.meta.csv: belongs to no source"));
}

Expected<std::vector<StampedPose>, std::string> trajectory_from(const std::string& text) {
  const TemporaryFile file{"gt.tum", bytes_of(text)};
  return read_trajectory(file.path());
}

TEST(MotionFiles, TrajectoryIsReadAsOdometryIs) {
  const auto poses = trajectory_from("# t x y z qx qy qz qw\n10.5 1 2 3 0 0 0.6 0.8\n11 4 5 6 0 0 0 1\n");
  ASSERT_TRUE(poses) << poses.error();
  ASSERT_EQ(poses->size(), 2u);
  EXPECT_EQ(to_ns((*poses)[0].stamp), 10'500'000'000);
  EXPECT_EQ((*poses)[0].T_source_base.translation, Eigen::Vector3d(1, 2, 3));
  EXPECT_DOUBLE_EQ((*poses)[0].T_source_base.rotation.z(), 0.6);
}

TEST(MotionFiles, UnusableTrajectoryIsRejectedWithItsLine) {
  const std::string good = "10 0 0 0 0 0 0 1\n";
  EXPECT_TRUE(contains(error_of(trajectory_from(good + "11 nan 0 0 0 0 0 1\n")), "gt.tum:2: the pose is not finite"));
  EXPECT_TRUE(contains(error_of(trajectory_from(good + "11 0 0 0 nan 0 0 1\n")), "gt.tum:2: the pose is not finite"));
  EXPECT_TRUE(contains(error_of(trajectory_from(good + "11 0 inf 0 0 0 0 1\n")), "gt.tum:2: the pose is not finite"));
  EXPECT_TRUE(contains(error_of(trajectory_from(good + "11 0 -1e300 0 0 0 0 1\n")),
                       "gt.tum:2: the position is more than 100000 km from the origin"));
  EXPECT_TRUE(trajectory_from(good + "11 4e6 -5e6 2e6 0 0 0 1\n")) << "geocentric";
  EXPECT_TRUE(contains(error_of(trajectory_from(good + "\n9 0 0 0 0 0 0 1\n")), "gt.tum:3: its time is not after"));
  EXPECT_TRUE(contains(error_of(trajectory_from(good + good)), "gt.tum:2: its time is not after"));
  EXPECT_TRUE(contains(error_of(trajectory_from(good + "11 0 0 0\n")), "gt.tum:2: 4 columns"));
  EXPECT_TRUE(contains(error_of(trajectory_from("")), "gt.tum: holds no pose"));
  EXPECT_TRUE(contains(error_of(trajectory_from("t x y z qx qy qz qw\n")), "gt.tum: holds no pose"));
}

/// Returns the stamps in ns, in reading order.
std::vector<std::int64_t> stamps_of(MotionSamples<OdometrySample> samples) {
  std::vector<std::int64_t> stamps;
  for (; samples.front() != nullptr; samples.pop())
    stamps.push_back(to_ns(samples.front()->stamp));
  return stamps;
}

std::string row_at(const char* time) { return std::string{time} + " 0 0 0 0 0 0 1\n"; }

TEST(MotionSamples, AreReadOneByOne) {
  const TemporaryFile file{"wio.tum", bytes_of("# t x y z qx qy qz qw\n" + row_at("1e-9") + "\n" + row_at("2e-9") +
                                               row_at("2e-9") + row_at("3e-9"))};
  auto samples = MotionSamples<OdometrySample>::open(file.path());
  ASSERT_TRUE(samples) << samples.error();
  EXPECT_EQ(stamps_of(std::move(*samples)), (std::vector<std::int64_t>{1, 2, 2, 3}));
}

TEST(MotionSamples, AreReadInOrderOfArrival) {
  const TemporaryFile file{"wio.tum", bytes_of(row_at("3e-9") + row_at("1e-9"))};
  auto samples = MotionSamples<OdometrySample>::open(file.path());
  ASSERT_TRUE(samples) << samples.error();
  EXPECT_EQ(stamps_of(std::move(*samples)), (std::vector<std::int64_t>{1, 3})) << "arrival is the stamp";

  const TemporaryFile meta{"wio.meta.csv", bytes_of("1,20,1\n3,10,1\n")};
  auto late = MotionSamples<OdometrySample>::open(file.path());
  ASSERT_TRUE(late) << late.error();
  EXPECT_EQ(stamps_of(std::move(*late)), (std::vector<std::int64_t>{3, 1})) << "the first came late";
}

TEST(MotionSamples, AreValidatedBeforeTheFirstIsUsed) {
  const TemporaryFile file{"wio.tum", bytes_of(row_at("1") + row_at("2") + "3 0 0\n")};
  EXPECT_TRUE(contains(error_of(MotionSamples<OdometrySample>::open(file.path())), "wio.tum:3: 3 columns"));
  EXPECT_TRUE(contains(error_of(MotionSamples<OdometrySample>::open("/nowhere/wio.tum")), "cannot be read"));
}

/// After a power failure each file may be truncated at a different row.
TEST(MotionSamples, AreReadUpToTheDamage) {
  const std::string rows = row_at("1") + row_at("2") + row_at("3");
  const std::string meta = "1000000000,1000000001,1\n2000000000,2000000002,2\n3000000000,3000000003,3\n";
  for (std::size_t kept = 0; kept <= rows.size(); ++kept) {
    for (std::size_t meta_kept = 0; meta_kept <= meta.size(); meta_kept += 5) {
      const TemporaryFile file{"wio.tum", bytes_of(rows.substr(0, kept))};
      const TemporaryFile meta_file{"wio.meta.csv", bytes_of(meta.substr(0, meta_kept))};
      auto samples = MotionSamples<OdometrySample>::open(file.path());
      ASSERT_TRUE(samples) << kept << ' ' << meta_kept << ' ' << samples.error();
      const auto whole = static_cast<std::size_t>(std::ranges::count(rows.substr(0, kept), '\n'));
      const std::vector<OdometrySample> read = samples->drain();
      EXPECT_GE(read.size(), whole);
      EXPECT_LE(read.size(), whole + 1) << "a last line may only lack its line feed";
    }
  }
  const TemporaryFile file{"wio.tum", bytes_of(row_at("1") + "2 0 0")};
  auto samples = MotionSamples<OdometrySample>::open(file.path());
  ASSERT_TRUE(samples);
  ASSERT_EQ(samples->breaks().size(), 1U);
  EXPECT_TRUE(
      contains(samples->breaks()[0], "wio.tum:2: 3 columns; expected t x y z qx qy qz qw; the file breaks off"));
  EXPECT_EQ(stamps_of(std::move(*samples)), std::vector<std::int64_t>{1'000'000'000});
  const TemporaryFile blocks{"wio.tum", bytes_of(row_at("1") + "2 0" + std::string(4096, '\0'))};
  EXPECT_EQ(MotionSamples<OdometrySample>::open(blocks.path())->drain().size(), 1U) << "blocks that were never written";
}

TEST(MotionSamples, PiecesFollowEachOtherEachWithItsOwnMeta) {
  const std::vector<std::string> names{"a.tum", "b.tum", "c.tum"};
  const TemporaryFile a{"a.tum", bytes_of(row_at("1") + row_at("2"))}, b{"b.tum", bytes_of("")},
      c{"c.tum", bytes_of(row_at("3") + row_at("4") + "5 0")};
  const TemporaryFile a_meta{"a.meta.csv", bytes_of("1000000000,1500000000,7\n2000000000,2500000000,8\n")};
  const TemporaryFile c_meta{"c.meta.csv", bytes_of("3000000000,3500000000,9\n4000000000,4500000000,10\n5000000000,5")};
  auto samples = MotionSamples<OdometrySample>::open({a.path(), b.path(), c.path()});
  ASSERT_TRUE(samples) << samples.error();
  EXPECT_EQ(to_ns(samples->arrivals()->first), 1'500'000'000);
  EXPECT_EQ(to_ns(samples->arrivals()->last), 4'500'000'000);
  EXPECT_EQ(samples->breaks().size(), 2U);
  const std::vector<OdometrySample> read = samples->drain();
  ASSERT_EQ(read.size(), 4U);
  for (std::size_t i = 0; i < read.size(); ++i) {
    EXPECT_EQ(to_ns(read[i].arrival), static_cast<std::int64_t>(i + 1) * 1'000'000'000 + 500'000'000);
    EXPECT_EQ(read[i].covariance_scale, 7.0 + static_cast<double>(i));
  }
  const TemporaryFile bad{"bad.tum", bytes_of("1 0\n")};
  EXPECT_TRUE(contains(error_of(MotionSamples<OdometrySample>::open({a.path(), bad.path()})), "bad.tum:1: 2 columns"));
}

/// A backward step of the clock between two samples must not reject the rest, in one file or across two.
TEST(MotionSamples, PipeIsReadOnce) {
  const test::TemporaryFolder folder;
  const std::filesystem::path pipe = folder / "wio.tum";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  std::thread writer([&] { std::ofstream{pipe} << "2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n3 0 0 0 0 0 0 1\n"; });
  auto samples = MotionSamples<OdometrySample>::open(pipe);
  writer.join();
  ASSERT_TRUE(samples) << samples.error();
  EXPECT_EQ(stamps_of(std::move(*samples)), (std::vector<std::int64_t>{1'000'000'000, 2'000'000'000, 3'000'000'000}));
}

TEST(MotionSamples, PiecesOutOfOrderAreSortedByArrival) {
  const TemporaryFile a{"a.tum", bytes_of(row_at("5") + row_at("6"))}, b{"b.tum", bytes_of(row_at("1") + row_at("2"))};
  const TemporaryFile a_meta{"a.meta.csv", bytes_of("5000000000,5000000001,1\n6000000000,6000000001,1\n7000000000,")};
  auto samples = MotionSamples<OdometrySample>::open({a.path(), b.path()});
  ASSERT_TRUE(samples) << samples.error();
  EXPECT_EQ(stamps_of(std::move(*samples)),
            (std::vector<std::int64_t>{1'000'000'000, 2'000'000'000, 5'000'000'000, 6'000'000'000}));
}

TEST(MotionFiles, LinesRoundTripToTheLastBit) {
  std::minstd_rand random(1);
  std::uniform_real_distribution<double> number(-1000, 1000);
  const auto vector = [&] { return Eigen::Vector3d(number(random), number(random) * 1e-12, number(random) * 1e12); };
  std::string imu_lines, odometry_lines;
  std::vector<ImuSample> imu;
  std::vector<StampedPose> odometry;
  for (int i = 0; i < 1000; ++i) {
    const Stamp stamp = stamp_from_ns(i % 2 == 0 ? 1'700'000'000'000'000'000 + i : std::int64_t{-1'234'567'890} * i);
    const Eigen::Quaterniond q =
        Eigen::Quaterniond(number(random), number(random), number(random), number(random)).normalized();
    imu.push_back({stamp, stamp, vector(), vector(), i % 3 == 0 ? std::nullopt : std::optional{q}});
    odometry.push_back({stamp, {q, vector()}});
    imu_lines += to_line(imu.back());
    odometry_lines += to_line(odometry.back());
  }
  const auto read_imu = parse_samples<ImuSample>(imu_lines, "imu.csv");
  const auto read_odometry = parse_samples<OdometrySample>(odometry_lines, "wio.tum");
  ASSERT_TRUE(read_imu) << read_imu.error();
  ASSERT_TRUE(read_odometry) << read_odometry.error();
  for (std::size_t i = 0; i < imu.size(); ++i) {
    EXPECT_EQ((*read_imu)[i].stamp, imu[i].stamp);
    EXPECT_EQ((*read_imu)[i].angular_velocity_radps, imu[i].angular_velocity_radps);
    EXPECT_EQ((*read_imu)[i].specific_force_mps2, imu[i].specific_force_mps2);
    ASSERT_EQ((*read_imu)[i].attitude.has_value(), imu[i].attitude.has_value());
    EXPECT_TRUE(!imu[i].attitude || (*read_imu)[i].attitude->coeffs() == imu[i].attitude->coeffs());
    EXPECT_EQ((*read_odometry)[i].stamp, odometry[i].stamp);
    EXPECT_TRUE((*read_odometry)[i].T_source_base == odometry[i].T_source_base);
  }
  EXPECT_EQ(to_line(StampedPose{stamp_from_ns(1'500'000'001), {}}, 3),
            "1.500000001 0.000 0.000 0.000 0.000 0.000 0.000 1.000\n");
}

TEST(MotionSamples, ReportTheFirstAndTheLastArrival) {
  for (const std::string& rows : {row_at("1e-9") + row_at("3e-9"), row_at("3e-9") + row_at("1e-9")}) {
    const TemporaryFile file{"wio.tum", bytes_of(rows)};
    const auto samples = MotionSamples<OdometrySample>::open(file.path());
    ASSERT_TRUE(samples && samples->arrivals());
    EXPECT_EQ(to_ns(samples->arrivals()->first), 1);
    EXPECT_EQ(to_ns(samples->arrivals()->last), 3);
  }
  const TemporaryFile empty{"wio.tum", bytes_of("# t x y z qx qy qz qw\n")};
  EXPECT_FALSE(MotionSamples<OdometrySample>::open(empty.path())->arrivals());
}

TEST(MotionSamples, DrainReturnsTheRest) {
  MotionSamples<ImuSample> samples(std::vector<ImuSample>(3));
  samples.pop();
  EXPECT_EQ(samples.drain().size(), 2u);
  EXPECT_EQ(samples.front(), nullptr);
  EXPECT_TRUE(samples.drain().empty());
  const TemporaryFile empty{"imu.csv", bytes_of("t_ns,wx,wy,wz,ax,ay,az\n")};
  EXPECT_EQ((*MotionSamples<ImuSample>::open(empty.path())).front(), nullptr);
}

} // namespace
} // namespace locus

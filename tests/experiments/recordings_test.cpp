// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/recordings.hpp"

#include <algorithm>
#include <fstream>

#include <gtest/gtest.h>

#include "locus_replay/failure.hpp"
#include "support/temporary_folder.hpp"

namespace locus::experiments {
namespace {

using std::filesystem::path;

/// Recordings are recognised by their names alone.
class FoundRecordings : public testing::Test {
 protected:
  void put(const std::string& name) const {
    std::filesystem::create_directories((folder_ / name).parent_path());
    std::ofstream{folder_ / name} << "nothing";
  }
  [[nodiscard]] std::vector<std::string> names_in(const std::vector<path>& places) const {
    std::vector<std::string> names;
    for (const FoundRecording& recording : find_recordings(places, folder_ / "output"))
      names.push_back(recording.name);
    return names;
  }
  test::TemporaryFolder folder_;
};

using Names = std::vector<std::string>;

TEST_F(FoundRecordings, AreAllOfLocusReplayAtAnyDepth) {
  for (const char* const name :
       {"README.md", "b/one.pcap", "b/two.pcapng", "b/expected.pcd", "a/robot/lidar.pcap", "a/robot/imu.csv", "d/r.bag",
        "c/ros2/metadata.yaml", "c/ros2/ros2_0.db3", "day/drive_0001_sync/velodyne_points/data/0000000000.bin",
        "record/000001_2026-11-22T08-12-05Z/000001/lidar.pcap", "both/lidar.pcap", "both/lidar.pcapng"})
    put(name);
  EXPECT_EQ(names_in({folder_.path()}), (Names{"a/robot", "b/one.pcap", "b/two.pcapng", "both", "c/ros2", "d/r.bag",
                                               "day/drive_0001_sync", "record"}));
}

TEST_F(FoundRecordings, InAFolderNamedVelodyneAreItsCaptures) {
  put("data/velodyne/one.pcap");
  put("data/velodyne/two.pcap");
  put("data/robot/lidar.pcap");
  EXPECT_EQ(names_in({folder_ / "data"}), (Names{"robot", "velodyne/one.pcap", "velodyne/two.pcap"}));
}

TEST_F(FoundRecordings, MayBeNamedThemselves) {
  put("robot/lidar.pcap");
  put("one.pcap");
  EXPECT_EQ(names_in({folder_ / "robot/", folder_ / "one.pcap"}), (Names{"robot", "one.pcap"}));
}

TEST_F(FoundRecordings, OfSeveralFoldersHaveUniqueNames) {
  put("a/data/one.pcap");
  put("b/data/one.pcap");
  EXPECT_EQ(names_in({folder_ / "a/data", folder_ / "b/data"}), (Names{"data/one.pcap", "data/one.pcap-2"}));
}

TEST_F(FoundRecordings, ExcludeTheOutputAndDuplicatesByLinks) {
  put("output/courses/x/lidar.pcap");
  put("a/one.pcap");
  std::filesystem::create_directory_symlink(folder_.path(), folder_ / "a/back");
  EXPECT_EQ(names_in({folder_.path()}), Names{"a/one.pcap"});
}

TEST_F(FoundRecordings, InAMissingFolderAreAnError) {
  EXPECT_THROW((void)names_in({folder_ / "nowhere"}), tools::Failure);
  EXPECT_TRUE(names_in({folder_.path()}).empty());
}

} // namespace
} // namespace locus::experiments

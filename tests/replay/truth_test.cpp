// SPDX-License-Identifier: Apache-2.0
#include <fstream>

#include <gtest/gtest.h>

#include "replay_run.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

using nlohmann::json;

/// Arguments of a run on the packets of the room alone, without the folder's truth.
std::vector<std::string> with(const std::string& option, const std::filesystem::path& file) {
  return {option, file.string(), (room_drive() / "lidar.pcap").string()};
}

std::filesystem::path written(const std::filesystem::path& file, const std::string& text) {
  std::ofstream{file} << text;
  return file;
}

void expect_refused(const std::string& option, const std::filesystem::path& file, const std::string& why) {
  const Replay replay(with(option, file));
  EXPECT_EQ(replay.run().status, 1);
  EXPECT_EQ(lines_of(replay.run().err).size(), 1U) << replay.run().err;
  EXPECT_NE(replay.run().err.find(why), std::string::npos) << replay.run().err;
  EXPECT_FALSE(std::filesystem::exists(replay.file("odometry.tum"))) << "known before the run";
}

TEST(Truth, OfTheFolderIsUsedAutomatically) {
  const Replay replay({room_drive().string()});
  const json summary = replay.summary();
  EXPECT_GT(summary["ape_m"]["mean"].get<double>(), 0.0);
  EXPECT_LT(summary["ape_m"]["max"].get<double>(), 0.05);
  EXPECT_GT(summary["end_drift_m"].get<double>(), 0.0);
  EXPECT_TRUE(summary["rpe_10m_percent"].is_null()) << "8 s at 1 m/s";
  EXPECT_FALSE(summary.contains("map_error_m"));
  EXPECT_NE(replay.run().out.find("truth "), std::string::npos) << replay.run().out;
}

TEST(Truth, NamedFileIsUsedInstead) {
  EXPECT_FALSE(Replay({(room_drive() / "lidar.pcap").string()}).summary().contains("ape_m"));
  const Replay replay(with("--ground-truth", room_drive() / "gt.tum"));
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_GT(replay.summary()["ape_m"]["rmse"].get<double>(), 0.0);
}

TEST(Truth, MapIsComparedWithTheTrueMap) {
  const Replay first({(room_drive() / "lidar.pcap").string()});
  const Replay second(with("--map-truth", first.file("map.pcd")));
  ASSERT_EQ(second.run().status, 0) << second.run().err;
  const json error = second.summary()["map_error_m"];
  EXPECT_NEAR(error["rmse"].get<double>(), 0.0, 1e-3) << "the same map, from the same packets";
  EXPECT_EQ(error["outliers"], 0);
}

TEST(Truth, TruthOfAnotherTimeFailsAfterTheResultsAreWritten) {
  const TemporaryFolder folder;
  const Replay replay(with("--ground-truth", written(folder / "gt.tum", "10 0 0 0 0 0 0 1\n11 0 0 0 0 0 0 1\n")));
  EXPECT_EQ(replay.run().status, 1);
  EXPECT_NE(replay.run().err.find("gt.tum: its poses (10.000 to 11.000 s)"), std::string::npos) << replay.run().err;
  EXPECT_FALSE(replay.summary().contains("ape_m"));
  EXPECT_GT(replay.trajectory().size(), 70U);
}

TEST(Truth, TruthOfAnotherTimeInTheFolderIsAWarning) {
  const TemporaryFolder folder;
  std::filesystem::copy(room_drive(), folder.path(), std::filesystem::copy_options::recursive);
  written(folder / "gt.tum", "10 0 0 0 0 0 0 1\n11 0 0 0 0 0 0 1\n");
  const Replay replay({folder.path().string()});
  EXPECT_EQ(replay.run().status, 0);
  EXPECT_NE(replay.run().err.find("warning: "), std::string::npos) << replay.run().err;
  EXPECT_NE(replay.run().err.find("gt.tum: its poses (10.000 to 11.000 s)"), std::string::npos) << replay.run().err;
  EXPECT_FALSE(replay.summary().contains("ape_m"));
}

TEST(Truth, MapOfAnotherPlaceIsAWarning) {
  const TemporaryFolder folder;
  const Replay replay(with("--map-truth", written(folder / "far.ply", "ply\nformat ascii 1.0\nelement vertex 2\n"
                                                                      "property float x\nproperty float y\n"
                                                                      "property float z\nend_header\n"
                                                                      "5000 0 0\n5001 0 0\n")));
  EXPECT_EQ(replay.run().status, 0);
  ASSERT_EQ(lines_of(replay.run().err).size(), 1U) << replay.run().err;
  EXPECT_NE(replay.run().err.find("warning: "), std::string::npos);
  EXPECT_NE(replay.run().err.find("far.ply: none of the "), std::string::npos) << replay.run().err;
}

TEST(Truth, UnreadableTruthFailsBeforeTheRun) {
  const TemporaryFolder folder;
  expect_refused("--ground-truth", folder / "none.tum", "none.tum: cannot be read");
  expect_refused("--ground-truth", written(folder / "empty.tum", ""), "empty.tum: holds no pose");
  expect_refused("--ground-truth", written(folder / "nan.tum", "10 0 0 0 0 0 0 1\n11 nan 0 0 0 0 0 1\n"), "nan.tum:2:");
  expect_refused("--ground-truth", written(folder / "order.tum", "10 0 0 0 0 0 0 1\n9.95 0 0 0 0 0 0 1\n"),
                 "order.tum:2:");
  expect_refused("--ground-truth", written(folder / "text.tum", "10 0 0 0 0 0 0 1\nabc\n"), "text.tum:2:");
  expect_refused("--map-truth", folder / "none.ply", "none.ply: cannot be read");
  expect_refused("--map-truth", written(folder / "text.ply", "no cloud\n"), "text.ply:1:");
  expect_refused("--map-truth",
                 written(folder / "short.ply", "ply\nformat binary_little_endian 1.0\nelement vertex 9\n"
                                               "property float x\nproperty float y\nproperty float z\nend_header\n"),
                 "short.ply: ends at byte");
}

} // namespace
} // namespace locus::test

// SPDX-License-Identifier: Apache-2.0
// PCD and PLY against PCL's independent reader and writer.
#include <cstring>
#include <string>

#include <gtest/gtest.h>
#include <pcl/io/pcd_io.h>
#include <pcl/io/ply_io.h>

#include "replay_run.hpp"
#include "support/test_drives.hpp"
#include "sweep_folder/sweep_points.hpp"

namespace locus::test {
namespace {

void expect_all_fields(const pcl::PCLPointCloud2& cloud) {
  std::string fields;
  for (const pcl::PCLPointField& field : cloud.fields)
    fields += field.name + (field.datatype == pcl::PCLPointField::FLOAT32  ? ":float "
                            : field.datatype == pcl::PCLPointField::UINT16 ? ":uint16 "
                                                                           : ":? ");
  EXPECT_EQ(fields, "x:float y:float z:float intensity:float time:float ring:uint16 lidar:uint16 ");
}

TEST(SweepsByPcl, PcdAndPlyAreReadWithAllFields) {
  const TemporaryFolder folder;
  const std::string pcd = folder / "pcd", ply = folder / "ply";
  ASSERT_EQ(Replay({"--duration", "1", "--sweeps", pcd, room_drive()}).run().status, 0);
  ASSERT_EQ(Replay({"--duration", "1", "--sweeps", ply, "--sweeps-format", "ply", room_drive()}).run().status, 0);
  pcl::PCLPointCloud2 from_pcd, from_ply;
  ASSERT_EQ(pcl::io::loadPCDFile(pcd + "/000005.pcd", from_pcd), 0);
  ASSERT_EQ(pcl::io::loadPLYFile(ply + "/000005.ply", from_ply), 0);
  expect_all_fields(from_pcd);
  expect_all_fields(from_ply);
  EXPECT_GT(from_pcd.width, 20'000U);
  EXPECT_EQ(from_ply.width * from_ply.height, from_pcd.width);
  EXPECT_EQ(from_ply.data, from_pcd.data);
}

/// The reverse direction: reads sweeps that PCL has written in each encoding.
TEST(SweepsByPcl, FilesOfPclAreReadToTheSameBytes) {
  const TemporaryFolder folder;
  ASSERT_EQ(Replay({"--duration", "1", "--sweeps", folder / "sweeps", room_drive()}).run().status, 0);
  pcl::PCLPointCloud2 cloud;
  ASSERT_EQ(pcl::io::loadPCDFile(folder / "sweeps/000005.pcd", cloud), 0);
  constexpr int kDigitsOfFloat = 9;
  pcl::PCDWriter writer;
  const Eigen::Vector4f origin = Eigen::Vector4f::Zero();
  const Eigen::Quaternionf level = Eigen::Quaternionf::Identity();
  ASSERT_EQ(writer.writeASCII(folder / "ascii.pcd", cloud, origin, level, kDigitsOfFloat), 0);
  ASSERT_EQ(writer.writeBinary(folder / "binary.pcd", cloud, origin, level), 0);
  ASSERT_EQ(writer.writeBinaryCompressed(folder / "compressed.pcd", cloud, origin, level), 0);
  for (const char* const name : {"ascii.pcd", "binary.pcd", "compressed.pcd"}) {
    tools::SweepPoints points;
    const auto problem = tools::read_pcd_points(folder / name, points);
    ASSERT_FALSE(problem) << *problem;
    ASSERT_EQ(points.data.size(), cloud.data.size()) << name;
    EXPECT_EQ(std::memcmp(points.data.data(), cloud.data.data(), cloud.data.size()), 0) << name;
    EXPECT_EQ(points.fields.size(), cloud.fields.size());
  }
}

} // namespace
} // namespace locus::test

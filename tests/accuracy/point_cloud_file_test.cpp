// SPDX-License-Identifier: Apache-2.0
#include "accuracy/point_cloud_file.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "support/temporary_file.hpp"

namespace locus {
namespace {

using test::bytes_of;
using test::TemporaryFile;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

struct Read {
  std::vector<Eigen::Vector3d> points;
  std::string error;
};

Read read(const std::string& content) {
  const TemporaryFile file{"cloud", bytes_of(content)};
  const auto cloud = PointCloudFile::open(file.path());
  if (!cloud)
    return {{}, cloud.error()};
  Read read;
  read.error =
      cloud->walk([&](auto block) { read.points.insert(read.points.end(), block.begin(), block.end()); }).value_or("");
  return read;
}

void expect_points(const std::string& content, const std::vector<Eigen::Vector3d>& expected) {
  const Read found = read(content);
  EXPECT_EQ(found.error, "");
  ASSERT_EQ(found.points.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i)
    EXPECT_EQ(found.points[i], expected[i]) << i;
}

void expect_error(const std::string& content, const std::string& part) {
  const std::string error = read(content).error;
  EXPECT_NE(error.find(part), std::string::npos) << "no '" << part << "' in: " << error;
  EXPECT_EQ(error.find('\n'), std::string::npos) << error;
}

template <class Number> std::string raw(Number number, bool reversed = false) {
  auto bytes = std::bit_cast<std::array<char, sizeof(Number)>>(number);
  if (reversed)
    std::ranges::reverse(bytes);
  return {bytes.data(), bytes.size()};
}

std::string ply(const std::string& format, const std::string& vertex, const std::string& data) {
  return "ply\nformat " + format + " 1.0\ncomment made by hand\n" + vertex + "end_header\n" + data;
}

const std::string kTwoFloats = "element vertex 2\nproperty float x\nproperty float y\nproperty float z\n";

TEST(PointCloudFile, PlyAsText) {
  expect_points(ply("ascii", kTwoFloats, "1 2 3\n-4.5 5e-1 6\n"), {{1, 2, 3}, {-4.5, 0.5, 6}});
  expect_points(ply("ascii", kTwoFloats, "1 2 3\r\n4 5 6"), {{1, 2, 3}, {4, 5, 6}});
}

TEST(PointCloudFile, PlyInEitherByteOrder) {
  for (const bool big : {false, true}) {
    std::string data;
    for (const float number : {1.0F, 2.0F, 3.0F, -4.5F, 0.5F, 6.0F})
      data += raw(number, big);
    expect_points(ply(big ? "binary_big_endian" : "binary_little_endian", kTwoFloats, data),
                  {{1, 2, 3}, {-4.5, 0.5, 6}});
  }
}

TEST(PointCloudFile, PlyWithOtherProperties) {
  const std::string vertex = "element vertex 1\nproperty uchar red\nproperty double x\nproperty float intensity\n"
                             "property double y\nproperty double z\nelement face 1\nproperty list uchar int i\n";
  expect_points(
      ply("binary_little_endian", vertex, "r" + raw(4e5 + 1e-6) + raw(9.0F) + raw(2.0) + raw(3.0) + "and then faces"),
      {{4e5 + 1e-6, 2, 3}});
  expect_points(ply("ascii", vertex, "255 1 0.5 2 3\n3 0 0 0\n"), {{1, 2, 3}});
}

TEST(PointCloudFile, PcdAsTextAndBinary) {
  const std::string header = "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS intensity x y z fpfh\n"
                             "SIZE 2 4 4 8 4\nTYPE U F F F F\nCOUNT 1 1 1 1 2\nWIDTH 1\nHEIGHT 1\n"
                             "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 1\n";
  expect_points(header + "DATA ascii\n7 1 2 3 0 0\n", {{1, 2, 3}});
  expect_points(header + "DATA binary\n" + raw<std::uint16_t>(7) + raw(1.0F) + raw(2.0F) + raw(3.0) + raw(0.0F) +
                    raw(0.0F),
                {{1, 2, 3}});
}

TEST(PointCloudFile, PointsWithoutCoordinatesAreDropped) {
  expect_points(ply("ascii", kTwoFloats, "nan nan nan\n4 5 6\n"), {{4, 5, 6}});
  expect_points(
      ply("binary_little_endian", kTwoFloats, raw(1.0F) + raw(kNan) + raw(3.0F) + raw(4.0F) + raw(5.0F) + raw(6.0F)),
      {{4, 5, 6}});
}

TEST(PointCloudFile, ManyBlocksGiveEveryPointOnce) {
  constexpr int kPoints = 100'000;
  std::string data;
  for (int i = 0; i < kPoints; ++i)
    data += raw(static_cast<float>(i)) + raw(0.0F) + raw(0.0F);
  const Read found = read(ply(
      "binary_little_endian",
      "element vertex " + std::to_string(kPoints) + "\nproperty float x\nproperty float y\nproperty float z\n", data));
  ASSERT_EQ(found.points.size(), static_cast<std::size_t>(kPoints));
  for (int i = 0; i < kPoints; ++i)
    ASSERT_EQ(found.points[static_cast<std::size_t>(i)].x(), i);
}

TEST(PointCloudFile, OtherFilesAreErrors) {
  expect_error("", "neither a PLY nor a PCD");
  expect_error("\x89PNG\r\n", "neither a PLY nor a PCD");
  expect_error(std::string(100'000, 'x'), "neither a PLY nor a PCD");
  EXPECT_NE(PointCloudFile::open("/nowhere/map.ply").error().find("cannot be read"), std::string::npos);
  EXPECT_NE(PointCloudFile::open("/tmp").error().find("cannot be read"), std::string::npos);
}

TEST(PointCloudFile, BrokenPlyIsReportedWithItsLine) {
  expect_error(ply("ascii", "element vertex 0\nproperty float x\nproperty float y\nproperty float z\n", ""),
               "contains no point");
  expect_error("ply\nformat ascii 1.0\nelement vertex 2\n", ":4: the header does not end");
  expect_error("ply\nformat ascii 1.0\nelement vertex many\n", ":3: many is not a number of points");
  expect_error("ply\nformat zip 1.0\n", ":2: unknown format zip");
  expect_error(ply("ascii", "element face 3\nelement vertex 2\n", ""), ":5: the element vertex is not the first");
  expect_error(ply("ascii", "element vertex 2\nproperty list uchar int x\n", ""), ":5: a property of type list");
  expect_error(ply("ascii", "element vertex 2\nproperty int x\n", ""), ":5: x is neither a float nor a double");
  expect_error(ply("ascii", "element vertex 2\nproperty float x\n", ""), ":6: the points lack x, y or z");
  expect_error(ply("ascii", kTwoFloats, "1 2 3\n"), ":10: the file ends after 1 of 2 points");
  expect_error(ply("ascii", kTwoFloats, "1 2 3\n1 b 3\n"), ":10: not the coordinates of a point");
  expect_error(ply("ascii", kTwoFloats, "1 2 3\n1 2\n"), ":10: not the coordinates of a point");
}

TEST(PointCloudFile, TruncatedBinaryFileIsAnErrorBeforeReading) {
  const std::string header = ply("binary_little_endian", kTwoFloats, "");
  expect_error(header + std::string(23, '\0'),
               "ends at byte " + std::to_string(header.size() + 23) + " after 1 of 2 points");
  expect_error(ply("binary_little_endian",
                   "element vertex 18446744073709551615\nproperty float x\nproperty float y\nproperty float z\n",
                   std::string(24, '\0')),
               "after 2 of 18446744073709551615 points");
}

TEST(PointCloudFile, BrokenPcdIsReportedWithItsLine) {
  const std::string begin = "VERSION 0.7\nFIELDS x y z\n";
  expect_error(begin + "SIZE 4 4\nTYPE F F F\nPOINTS 1\nDATA ascii\n1 2 3\n", ":6: SIZE does not have as many values");
  expect_error(begin + "SIZE 4 4 four\nTYPE F F F\nPOINTS 1\nDATA ascii\n", ":6: SIZE or COUNT of z");
  expect_error(begin + "SIZE 4 4 4\nTYPE F F I\nPOINTS 1\nDATA ascii\n", ":6: z is neither a float nor a double");
  expect_error(begin + "POINTS -1\n", ":3: POINTS is not a number");
  expect_error(begin + "SIZE 4 4 4\nTYPE F F F\nPOINTS 1\nDATA binary_compressed\n", "convert the map to DATA binary");
  expect_error(begin + "nonsense\n", ":3: not a line of a PCD header");
}

} // namespace
} // namespace locus

// SPDX-License-Identifier: Apache-2.0
// Files of one sweep: PCD in its three encodings, valid and damaged.
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <span>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "support/errors.hpp"
#include "support/pcd_text.hpp"
#include "support/temporary_file.hpp"
#include "sweep_folder/lzf.hpp"
#include "sweep_folder/sweep_points.hpp"

namespace locus::test {
namespace {

using tools::SweepPoints;

template <class Number> std::string little_endian(Number number) {
  const auto bytes = std::bit_cast<std::array<char, sizeof(Number)>>(number);
  return {bytes.data(), bytes.size()};
}

struct ReadPcd {
  SweepPoints points;
  std::string problem;
};

ReadPcd read(const std::string& content) {
  const TemporaryFile file{"sweep.pcd", bytes_of(content)};
  ReadPcd read;
  read.problem = tools::read_pcd_points(file.path(), read.points).value_or("");
  return read;
}

void expect_problem(const std::string& content, const std::string& part) {
  const std::string problem = read(content).problem;
  EXPECT_TRUE(contains(problem, part)) << "no '" << part << "' in: " << problem;
}

template <class Number> Number number_at(const SweepPoints& points, std::size_t point, const std::string& field) {
  for (const SweepPoints::Field& f : points.fields) {
    Number number{};
    if (f.name == field) {
      std::memcpy(&number, points.data.data() + point * points.point_step + f.offset, sizeof(number));
      return number;
    }
  }
  ADD_FAILURE() << "no field " << field;
  return {};
}

std::string header(const std::string& fields, const std::string& sizes, const std::string& types,
                   const std::string& rest) {
  return "# .PCD v.7\nVERSION .7\nFIELDS " + fields + "\nSIZE " + sizes + "\nTYPE " + types + "\n" + rest;
}

const std::string kXyzOfTwo = header("x y z", "4 4 4", "F F F", "WIDTH 2\nHEIGHT 1\nPOINTS 2\n");

TEST(SweepPoints, TextIsConvertedToTheTypeOfEachField) {
  const ReadPcd got = read(header("x y z ring t stamp", "4 8 4 2 4 8", "F F F U U U",
                                  "COUNT 1 1 1 1 1 1\nWIDTH 1\nHEIGHT 1\nPOINTS 1\nDATA ascii\n") +
                           "1.5 -2e3 nan 65535 4294967295 1403636579763555584\n");
  ASSERT_EQ(got.problem, "");
  EXPECT_EQ(number_at<float>(got.points, 0, "x"), 1.5F);
  EXPECT_EQ(number_at<double>(got.points, 0, "y"), -2000.0);
  EXPECT_TRUE(std::isnan(number_at<float>(got.points, 0, "z")));
  EXPECT_EQ(number_at<std::uint16_t>(got.points, 0, "ring"), 65535);
  EXPECT_EQ(number_at<std::uint32_t>(got.points, 0, "t"), 4294967295U);
  EXPECT_EQ(number_at<double>(got.points, 0, "stamp"), 1403636579763555584.0);
}

TEST(SweepPoints, FieldsOfSeveralNumbersAreDroppedAndRowsRetained) {
  const std::string head =
      "VERSION .7\nFIELDS hist x y z\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 2 1 1 1\nWIDTH 1\nHEIGHT 2\n"
      "POINTS 2\n";
  const std::string point =
      little_endian(9.0F) + little_endian(9.0F) + little_endian(1.0F) + little_endian(2.0F) + little_endian(3.0F);
  for (const ReadPcd& got : {read(fmt::format("{}DATA binary\n{}{}", head, point, point)),
                             read(head + "DATA ascii\n9 9 1 2 3\r\n 9 9  1 2 3")}) {
    ASSERT_EQ(got.problem, "");
    EXPECT_EQ(got.points.fields.size(), 3U);
    EXPECT_EQ(got.points.height, 2U);
    EXPECT_EQ(got.points.view(stamp_from_ns(1)).row_step, got.points.point_step);
    EXPECT_EQ(number_at<float>(got.points, 1, "z"), 3.0F);
  }
}

TEST(SweepPoints, InvalidOrTruncatedPcdIsAnError) {
  expect_problem("", "1: not a PCD file");
  expect_problem("\x89PNG\r\n", "1: not a PCD file");
  expect_problem("# .PCD v.7\nFIELDS x y z\n", "3: the header does not end");
  expect_problem(header("x y", "4 4", "F F", "POINTS 1\nDATA ascii\n"), "its points have no z");
  expect_problem(header("x y z", "4 4 4", "F F F", "POINTS 1\nDATA zip\n"), "unknown DATA zip");
  expect_problem(kXyzOfTwo + "DATA ascii\n1 2 3\n", "11: the file ends after 1 of 2 points");
  expect_problem(kXyzOfTwo + "DATA ascii\n1 2 3\n1 2\n", "11: not the 3 fields of a point");
  expect_problem(kXyzOfTwo + "DATA ascii\n1 2 3\n1 2 three\n", "11: not the 3 fields of a point");
  expect_problem(kXyzOfTwo + "DATA ascii\n1 2 3 4\n", "10: not the 3 fields of a point");
  expect_problem(kXyzOfTwo + "DATA binary\n" + std::string(23, '\0'), "after 1 of 2 points");
  expect_problem(kXyzOfTwo + "DATA binary_compressed\n" + little_endian(4U), "are truncated");
  expect_problem(kXyzOfTwo + "DATA binary_compressed\n" + little_endian(4'000'000'000U) + little_endian(24U),
                 "are truncated");
  expect_problem(kXyzOfTwo + "DATA binary_compressed\n" + little_endian(2U) + little_endian(24U) +
                     std::string(2, '\xFF'),
                 "damaged");
  expect_problem(kXyzOfTwo + "DATA binary_compressed\n" + little_endian(1U) + little_endian(4'000'000'000U) + "x",
                 "damaged");
}

TEST(SweepPoints, AbsurdNumbersAllocateNoMemory) {
  for (const char* const points : {"18446744073709551615", "4000000000", "2000000"})
    expect_problem(header("x y z", "4 4 4", "F F F", fmt::format("POINTS {}\nDATA binary\n", points)),
                   "more than a sweep may have");
  expect_problem(
      "VERSION .7\nFIELDS x y z h\nSIZE 4 4 4 8\nTYPE F F F F\nCOUNT 1 1 1 100000\nPOINTS 1000000\nDATA binary\n",
      "more than a sweep may have");
}

TEST(Lzf, RoundTrips) {
  std::string bytes;
  for (int i = 0; i < 1000; ++i)
    bytes += std::string(static_cast<std::size_t>(i % 40 + i % 7 * 60), static_cast<char>(i));
  const std::string packed = packed_by_lzf(bytes);
  EXPECT_LT(packed.size(), bytes.size());
  std::string unpacked(bytes.size(), '\0');
  EXPECT_TRUE(tools::unpack_lzf(std::as_bytes(std::span(packed)), std::as_writable_bytes(std::span(unpacked))));
  EXPECT_TRUE(unpacked == bytes);
  for (const std::size_t length : {bytes.size() - 1, bytes.size() + 1}) {
    unpacked.resize(length);
    EXPECT_FALSE(tools::unpack_lzf(std::as_bytes(std::span(packed)), std::as_writable_bytes(std::span(unpacked))));
  }
}

/// "ab", then a back reference of four bytes at offset two, which overlaps its own output.
TEST(Lzf, ReferencesMayOverlapTheirOutput) {
  const std::string packed{"\x01"
                           "ab"
                           "\x40\x01",
                           5};
  std::string unpacked(6, '\0');
  EXPECT_TRUE(tools::unpack_lzf(std::as_bytes(std::span(packed)), std::as_writable_bytes(std::span(unpacked))));
  EXPECT_EQ(unpacked, "ababab");
  const std::string too_far{"\x01"
                            "ab"
                            "\x40\x02",
                            5};
  EXPECT_FALSE(tools::unpack_lzf(std::as_bytes(std::span(too_far)), std::as_writable_bytes(std::span(unpacked))));
  for (const std::size_t cut : {1U, 2U, 4U})
    EXPECT_FALSE(
        tools::unpack_lzf(std::as_bytes(std::span(packed)).first(cut), std::as_writable_bytes(std::span(unpacked))));
}

} // namespace
} // namespace locus::test

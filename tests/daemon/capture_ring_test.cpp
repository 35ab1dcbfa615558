// SPDX-License-Identifier: Apache-2.0
#include "daemon/capture_ring.hpp"

#include <gtest/gtest.h>

#include <fstream>

#include "support/errors.hpp"
#include "support/temporary_folder.hpp"

namespace locus::daemon {
namespace {

constexpr std::uint64_t kMaxBytes = 16'000'000;
constexpr Stamp kNow = stamp_from_ns(1'700'000'000'000'000'000);

/// A piece of as many bytes as it may have.
std::filesystem::path fill_piece(CaptureRing& ring) {
  const auto piece = ring.begin_piece(kNow);
  EXPECT_TRUE(piece) << piece.error();
  std::ofstream{*piece / "lidar.pcap"} << std::string(ring.piece_bytes(), 'x');
  ring.end_piece();
  return *piece;
}

TEST(CaptureRing, OldestPiecesGoFirstWhicheverRunTheyAreOf) {
  const test::TemporaryFolder folder;
  CaptureRing first(folder / "record", kMaxBytes);
  std::vector<std::filesystem::path> pieces;
  for (int i = 0; i < 3; ++i)
    pieces.push_back(fill_piece(first));
  EXPECT_EQ(pieces[0], folder / "record/000001_2023-11-14T22-13-20Z/000001");

  CaptureRing second(folder / "record", kMaxBytes);
  while (std::filesystem::exists(pieces[0]) && pieces.size() < 30)
    pieces.push_back(fill_piece(second));
  EXPECT_EQ(pieces[3], folder / "record/000002_2023-11-14T22-13-20Z/000001");
  EXPECT_GE(pieces.size(), 16U);
  EXPECT_LE(second.bytes(), kMaxBytes);
  for (std::size_t i = 1; i < 3; ++i) {
    EXPECT_TRUE(std::filesystem::exists(pieces[i]));
    pieces.push_back(fill_piece(second));
    EXPECT_FALSE(std::filesystem::exists(pieces[i]));
    EXPECT_LE(second.bytes(), kMaxBytes);
  }
  EXPECT_FALSE(std::filesystem::exists(first.run())) << "none of its pieces is left";
}

TEST(CaptureRing, NothingElseIsTouched) {
  const test::TemporaryFolder folder;
  const std::filesystem::path record = folder / "record";
  std::filesystem::path run;
  {
    CaptureRing ring(record, kMaxBytes);
    fill_piece(ring);
    run = ring.run();
  }
  std::filesystem::rename(run, record / "keep_the_crash");
  for (const char* other : {"20261122", "000001_notes", "000001_2023-11-14T22-13-20Z.bak"}) {
    std::filesystem::create_directories(record / other / "000001");
    std::ofstream{record / other / "000001/file"} << std::string(1'000'000, 'x');
  }
  CaptureRing ring(record, kMaxBytes);
  for (int i = 0; i < 40; ++i)
    fill_piece(ring);
  EXPECT_TRUE(std::filesystem::exists(record / "keep_the_crash/000001/lidar.pcap"));
  for (const char* other : {"20261122", "000001_notes", "000001_2023-11-14T22-13-20Z.bak"})
    EXPECT_TRUE(std::filesystem::exists(record / other / "000001/file"));
}

TEST(CaptureRing, LowerBoundThanBeforeIsKept) {
  const test::TemporaryFolder folder;
  CaptureRing large(folder / "record", 2 * kMaxBytes);
  for (int i = 0; i < 16; ++i)
    fill_piece(large);
  CaptureRing small(folder / "record", kMaxBytes);
  fill_piece(small);
  EXPECT_LE(small.bytes(), kMaxBytes);
}

TEST(CaptureRing, DiscardedPieceLeavesNothingBehind) {
  const test::TemporaryFolder folder;
  CaptureRing ring(folder / "record", kMaxBytes);
  ASSERT_TRUE(ring.begin_piece(kNow));
  ring.discard_piece();
  EXPECT_TRUE(std::filesystem::is_empty(folder / "record"));
  EXPECT_EQ(ring.bytes(), 0U);
  EXPECT_TRUE(ring.begin_piece(kNow));
}

TEST(CaptureRing, DiskThatIsTooSmallIsNotEmptiedForNothing) {
  const test::TemporaryFolder folder;
  CaptureRing ring(folder / "record", kMaxBytes);
  const std::filesystem::path piece = fill_piece(ring);
  CaptureRing huge(folder / "record", 1'000'000'000'000'000);
  EXPECT_TRUE(contains(error_of(huge.begin_piece(kNow)), "MB free on the disk, and 125000000 are wanted"));
  EXPECT_TRUE(std::filesystem::exists(piece));
}

TEST(CaptureRing, FolderThatWasRemovedIsMadeAgain) {
  const test::TemporaryFolder folder;
  CaptureRing ring(folder / "record", kMaxBytes);
  for (int i = 0; i < 3; ++i)
    fill_piece(ring);
  std::filesystem::remove_all(folder / "record");
  EXPECT_TRUE(contains(error_of(ring.begin_piece(kNow)), "record: cannot be looked at"));
  const std::filesystem::path piece = fill_piece(ring);
  EXPECT_TRUE(std::filesystem::exists(piece));
  EXPECT_LT(ring.bytes(), kMaxBytes / 10) << "what is gone takes no room";
}

TEST(CaptureRing, FolderThatCannotBeMadeIsAnError) {
  const test::TemporaryFolder folder;
  std::ofstream{folder / "plain"} << "a file";
  CaptureRing ring(folder / "plain/record", kMaxBytes);
  for (int attempt = 0; attempt < 2; ++attempt)
    EXPECT_TRUE(contains(error_of(ring.begin_piece(kNow)), "plain/record: cannot be made (Not a directory)"));
}

} // namespace
} // namespace locus::daemon

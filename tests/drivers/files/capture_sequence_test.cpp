// SPDX-License-Identifier: Apache-2.0
#include "drivers/files/capture_sequence.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <vector>

#include "drivers/files/pcap_writer.hpp"
#include "support/errors.hpp"
#include "support/temporary_file.hpp"

namespace locus {
namespace {

using test::TemporaryFile;

TEST(CaptureSequence, ReadsPiecesInOrderAndSkipsUnstartedOnes) {
  const TemporaryFile first{"1.pcap"}, begun{"2.pcap", {}}, cut{"3.pcap"}, last{"4.pcap"};
  std::int64_t ns = 0;
  for (const TemporaryFile* file : {&first, &cut, &last}) {
    PcapWriter writer = std::move(*PcapWriter::open(file->path()));
    for (int i = 0; i < 3; ++i)
      writer.write(stamp_from_ns(++ns), {}, Bytes(100));
  }
  std::filesystem::resize_file(cut.path(), std::filesystem::file_size(cut.path()) - 10);
  auto sequence = CaptureSequence::open({first.path(), begun.path(), cut.path(), last.path()});
  ASSERT_TRUE(sequence) << sequence.error();
  std::vector<std::int64_t> stamps;
  double progress = 0.0;
  while (const Datagram* datagram = sequence->next()) {
    stamps.push_back(to_ns(datagram->receive_stamp));
    EXPECT_GE(sequence->progress(), progress);
    progress = sequence->progress();
  }
  EXPECT_EQ(stamps, (std::vector<std::int64_t>{1, 2, 3, 4, 5, 7, 8, 9}));
  EXPECT_EQ(sequence->datagrams(), 8U);
  EXPECT_DOUBLE_EQ(sequence->progress(), 1.0);
  ASSERT_EQ(sequence->warnings().size(), 2U);
  EXPECT_TRUE(contains(sequence->warnings()[0], "2.pcap: the file is empty"));
  EXPECT_TRUE(contains(sequence->warnings()[1], "3.pcap: byte "));
  EXPECT_TRUE(contains(error_of(CaptureSequence::open({begun.path()})), "2.pcap: the file is empty"));
}

TEST(PcapWriter, FlushReportsAFullDisk) {
  auto writer = PcapWriter::open("/dev/full");
  ASSERT_TRUE(writer);
  for (int i = 0; i < 100; ++i)
    writer->write(stamp_from_ns(i), {}, Bytes(1206));
  EXPECT_TRUE(contains(writer->flush().value_or(""), "/dev/full: cannot be written (No space left on device)"));
  EXPECT_TRUE(contains(error_of(PcapWriter::open("/nowhere/lidar.pcap")), "/nowhere/lidar.pcap: cannot be written"));
}

TEST(PcapWriter, ReportsTheFileSize) {
  const TemporaryFile file{"bytes.pcap"};
  auto writer = PcapWriter::open(file.path());
  for (int i = 0; i < 10; ++i)
    writer->write(stamp_from_ns(i), {}, Bytes(1206));
  ASSERT_FALSE(writer->flush());
  EXPECT_EQ(writer->bytes(), std::filesystem::file_size(file.path()));
}

} // namespace
} // namespace locus

// SPDX-License-Identifier: Apache-2.0
#include "drivers/files/pcapng_reader.hpp"

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <pcap/dlt.h>

#include "capture_bytes.hpp"
#include "support/errors.hpp"
#include "support/pcapng_file.hpp"
#include "support/temporary_file.hpp"

namespace locus {
namespace {

using test::linux_cooked;
using test::opened;
using test::payload_of;
using test::PcapngFile;
using test::TemporaryFile;

/// Reads all datagrams: their stamps in ns.
std::vector<std::int64_t> stamps_in(const Bytes& file_bytes, const std::string& name = "any.pcapng") {
  const TemporaryFile file{name, file_bytes};
  Capture capture = opened(file.path());
  std::vector<std::int64_t> stamps;
  while (const Datagram* datagram = capture.next()) {
    EXPECT_EQ(datagram->payload.size(), 31u);
    stamps.push_back(to_ns(datagram->receive_stamp));
  }
  EXPECT_EQ(capture.warnings(), std::vector<std::string>{});
  return stamps;
}

TEST(Pcapng, IsReadWithItsNanosecondsAndCutAtAnyByte) {
  PcapngFile written;
  written.add_interface(DLT_EN10MB, 0, 9);
  const std::size_t header_size = written.bytes().size();
  written.add_frame(0, 1'700'000'000'123'456'789, ethernet(ipv4_udp({}, payload_of(31))));
  const std::size_t record_size = written.bytes().size() - header_size;
  written.add_frame(0, 1'700'000'000'123'456'790, ethernet(ipv4_udp({}, payload_of(31))));
  const Bytes& whole = written.bytes();
  const TemporaryFile file{"whole.pcapng", whole};
  {
    Capture capture = opened(file.path());
    const Datagram* datagram = capture.next();
    ASSERT_NE(datagram, nullptr);
    EXPECT_EQ(to_ns(datagram->receive_stamp), 1'700'000'000'123'456'789);
    EXPECT_EQ(datagram->payload.size(), 31u);
  }
  for (std::size_t size = 0; size <= whole.size(); ++size) {
    SCOPED_TRACE(size);
    file.write(std::span{whole}.first(size));
    if (size < header_size) {
      EXPECT_NE(error_of(Capture::open(file.path())), "");
      continue;
    }
    Capture capture = opened(file.path());
    while (capture.next() != nullptr) {
    }
    EXPECT_EQ(capture.stats().datagrams, (size - header_size) / record_size);
    EXPECT_EQ(capture.warnings().empty(), (size - header_size) % record_size == 0);
  }
}

/// libpcap stops where an interface differs from the first in link type or snap length, and captures on "any" or on
/// several cards have such.
TEST(Pcapng, OfInterfacesOfAnyKindIsRead) {
  constexpr std::uint64_t kTime_us = 1'700'000'000'123'456;
  const Bytes ip = ipv4_udp({}, payload_of(31));
  for (const bool is_big_endian : {false, true}) {
    PcapngFile file{is_big_endian};
    file.add_interface(DLT_LINUX_SLL, 262144);
    file.add_interface(DLT_EN10MB, 65535);
    file.add_frame(1, kTime_us, ethernet(ip));
    file.add_block(5, Bytes(8)); // statistics
    file.add_frame(0, kTime_us + 1, linux_cooked(ip));
    file.add_interface(189, 0); // USB, in the middle
    file.add_frame(2, kTime_us + 2, Bytes(64));
    file.add_interface(101, 0); // raw IP
    file.add_frame(3, kTime_us + 3, ip);
    file.add_old_frame(1, kTime_us + 4, ethernet(ip));
    EXPECT_EQ(stamps_in(file.bytes()),
              (std::vector<std::int64_t>{1'700'000'000'123'456'000, 1'700'000'000'123'457'000,
                                         1'700'000'000'123'459'000, 1'700'000'000'123'460'000}));
  }
}

TEST(Pcapng, OfSeveralSectionsIsReadInTheByteOrderOfEach) {
  const Bytes frame = ethernet(ipv4_udp({}, payload_of(31)));
  PcapngFile file{true};
  file.add_interface(DLT_EN10MB, 0);
  file.add_frame(0, 1'000'000, frame);
  file.start_section(false);
  file.add_interface(189, 0);
  file.add_interface(DLT_EN10MB, 0, 9);
  file.add_frame(1, 2'000'000'000, frame);
  file.start_section(true);
  file.add_interface(DLT_EN10MB, 0);
  file.add_frame(0, 3'000'000, frame);
  EXPECT_EQ(stamps_in(file.bytes()), (std::vector<std::int64_t>{1'000'000'000, 2'000'000'000, 3'000'000'000}));
}

/// The kinds of the public test suite pcapng-test-generator: name resolution, statistics, journal, secrets, custom, and
/// blocks that no version knows, in sections of either order, also before the interface and in sections without
/// packets.
TEST(Pcapng, BlocksWithoutPacketsAreSkipped) {
  const Bytes frame = ethernet(ipv4_udp({}, payload_of(31)));
  constexpr std::array<std::uint32_t, 10> kWithoutPackets{4, 5, 7, 8, 9, 10, 0xBAD, 0x40000BAD, 0x80000001, 0xFFFFFFFF};
  for (const bool is_big_endian : {false, true}) {
    PcapngFile file{is_big_endian};
    std::vector<std::int64_t> expected;
    for (int section = 0; section < 3; ++section) {
      for (const std::uint32_t type : kWithoutPackets)
        file.add_block(type, Bytes(4 * (type % 7)));
      file.add_interface(DLT_EN10MB, 0, 9);
      for (const std::uint32_t type : kWithoutPackets) {
        file.add_block(type, Bytes(4 * (type % 5)));
        file.add_frame(0, 1'000 + expected.size(), frame);
        expected.push_back(static_cast<std::int64_t>(1'000 + expected.size()));
      }
      file.start_section(is_big_endian); // without packets
      file.start_section(section == 0 ? !is_big_endian : is_big_endian);
    }
    EXPECT_EQ(stamps_in(file.bytes()), expected);
  }
}

TEST(Pcapng, SectionsWithoutInterfaceAreReported) {
  PcapngFile file;
  file.add_block(0xBAD, Bytes(8));
  file.start_section(true);
  const TemporaryFile temporary{"empty.pcapng", file.bytes()};
  EXPECT_TRUE(contains(error_of(Capture::open(temporary.path())), "no interface is described"));
}

TEST(Pcapng, OptionsAreSkipped) {
  const Bytes frame = ethernet(ipv4_udp({}, payload_of(31)));
  PcapngFile file;
  file.add_interface(DLT_EN10MB, 0, 9);
  file.add_frame(
      0, 1'000, frame,
      Bytes{
          std::byte{1}, {}, std::byte{5}, {}, std::byte{'n'}, std::byte{'o'}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}});
  file.add_frame(0, 2'000, frame, Bytes(16, std::byte{0xFF})); // options that reach beyond the block
  EXPECT_EQ(stamps_in(file.bytes()), (std::vector<std::int64_t>{1'000, 2'000}));
}

TEST(Pcapng, TimesAreInTheUnitOfTheirInterface) {
  const Bytes frame = ethernet(ipv4_udp({}, payload_of(31)));
  PcapngFile file;
  file.add_interface(DLT_EN10MB, 0, 0);
  file.add_interface(DLT_EN10MB, 0, 3);
  file.add_interface(DLT_EN10MB, 0, 12);
  file.add_interface(DLT_EN10MB, 0, 0x80 | 10);
  file.add_interface(DLT_EN10MB, 0, 6, 100);
  file.add_frame(0, 7, frame);
  file.add_frame(1, 7'001, frame);
  file.add_frame(2, 7'250'000'000'000, frame);
  file.add_frame(3, 7 * 1024 + 512, frame);
  file.add_frame(4, 7'000'000, frame);
  file.add_frame_without_time(frame);
  EXPECT_EQ(stamps_in(file.bytes()), (std::vector<std::int64_t>{7'000'000'000, 7'001'000'000, 7'250'000'000,
                                                                7'500'000'000, 107'000'000'000, 0}));
}

TEST(Pcapng, OfForeignLinkTypesAloneNamesThem) {
  PcapngFile file;
  file.add_interface(189, 0);
  file.add_frame(0, 1, Bytes(64));
  const TemporaryFile temporary{"usb.pcapng", file.bytes()};
  Capture capture = opened(temporary.path());
  EXPECT_EQ(capture.next(), nullptr);
  EXPECT_TRUE(contains(capture.why_none(), "link type USB_LINUX (189)")) << capture.why_none();
}

TEST(Pcapng, DamagedFileIsReadUpToTheDamage) {
  const Bytes frame = ethernet(ipv4_udp({}, payload_of(31)));
  PcapngFile good;
  good.add_interface(DLT_EN10MB, 0);
  good.add_frame(0, 1, frame);
  PcapngFile undescribed = good;
  undescribed.add_frame(1, 2, frame);
  PcapngFile short_packet = good;
  short_packet.add_block(6, Bytes(8));
  Bytes lengths = undescribed.bytes();
  lengths.back() = std::byte{0x11};
  for (const Bytes& bytes : {undescribed.bytes(), short_packet.bytes(), lengths}) {
    const TemporaryFile temporary{"damaged.pcapng", bytes};
    Capture capture = opened(temporary.path());
    EXPECT_NE(capture.next(), nullptr);
    EXPECT_EQ(capture.next(), nullptr);
    ASSERT_EQ(capture.warnings().size(), 1U);
    EXPECT_TRUE(contains(capture.warnings()[0], "the capture is damaged")) << capture.warnings()[0];
    EXPECT_TRUE(contains(capture.warnings()[0], "the 1 frames before it are used")) << capture.warnings()[0];
  }
}

/// Every single-byte corruption of a pcapng file gives data or a sentence.
TEST(Pcapng, CorruptedFileNeverCrashes) {
  PcapngFile file;
  file.add_interface(DLT_EN10MB, 65535, 9, 3);
  file.add_frame(0, 1, ethernet(ipv4_udp({}, payload_of(31))));
  file.add_frame_without_time(ethernet(ipv4_udp({}, payload_of(31))));
  const TemporaryFile temporary{"corrupt.pcapng", file.bytes()};
  for (std::size_t at = 0; at < file.bytes().size(); ++at) {
    for (const unsigned value : {0U, 1U, 0x7FU, 0xFFU}) {
      Bytes bytes = file.bytes();
      bytes[at] = static_cast<std::byte>(value);
      temporary.write(bytes);
      Expected<Capture, std::string> capture = Capture::open(temporary.path());
      if (!capture) {
        EXPECT_NE(capture.error(), "");
        continue;
      }
      while (capture->next() != nullptr) {
      }
      const Capture::Stats& s = capture->stats();
      EXPECT_EQ(s.datagrams + s.not_ip + s.ipv6 + s.fragments + s.not_udp + s.malformed, s.frames);
    }
  }
}

TEST(Pcapng, TimeBeyondAllStampsIsMalformed) {
  PcapngFile late;
  late.add_interface(DLT_EN10MB, 0, 9);
  late.add_frame(0, ~0ULL, ethernet(ipv4_udp({}, payload_of(31))));
  const TemporaryFile file{"late.pcapng", late.bytes()};
  Capture capture = opened(file.path());
  EXPECT_EQ(capture.next(), nullptr);
  EXPECT_EQ(capture.stats().malformed, 1u);
}

} // namespace
} // namespace locus

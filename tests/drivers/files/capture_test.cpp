// SPDX-License-Identifier: Apache-2.0
#include "drivers/files/capture.hpp"

#include <algorithm>
#include <map>
#include <optional>
#include <random>

#include <gtest/gtest.h>
#include <pcap/pcap.h>

#include "capture_bytes.hpp"
#include "drivers/files/pcap_writer.hpp"
#include "drivers/files/udp_frame.hpp"
#include "support/errors.hpp"
#include "support/temporary_file.hpp"
#include "support/test_data.hpp"

namespace locus {
namespace {

using test::append_little_endian;
using test::opened;
using test::payload_of;
using test::TemporaryFile;

/// Returns the payload of the single datagram in a file of one frame; nothing if there is none.
std::optional<Bytes> payload_in(int link_type, const Bytes& frame) {
  const TemporaryFile file{"single.pcap"};
  { PcapWriter::open(file.path(), link_type)->write_frame(stamp_from_ns(1), frame); }
  Capture capture = opened(file.path());
  const Datagram* datagram = capture.next();
  if (datagram == nullptr) {
    return std::nullopt;
  }
  return Bytes{datagram->payload.begin(), datagram->payload.end()};
}

/// Returns the counters after reading an Ethernet capture of one frame.
Capture::Stats stats_after(const Bytes& frame) {
  const TemporaryFile file{"single.pcap"};
  { PcapWriter::open(file.path())->write_frame(stamp_from_ns(1), frame); }
  Capture capture = opened(file.path());
  while (capture.next() != nullptr) {
  }
  return capture.stats();
}

Bytes with_16(Bytes bytes, std::size_t at, std::uint16_t value) {
  bytes.at(at) = static_cast<std::byte>(value >> 8);
  bytes.at(at + 1) = static_cast<std::byte>(value & 0xFF);
  return bytes;
}

TEST(Capture, RetainsAddressesPayloadAndNanoseconds) {
  const TemporaryFile file{"one.pcap"};
  const Bytes payload = payload_of(1206);
  {
    PcapWriter::open(file.path())
        ->write(stamp_from_ns(1'700'000'000'123'456'789), {0xC0A801C9, 2369, 0xFFFFFFFF, 2368}, payload);
  }
  Capture capture = opened(file.path());
  const Datagram* datagram = capture.next();
  ASSERT_NE(datagram, nullptr);
  EXPECT_EQ(to_ns(datagram->receive_stamp), 1'700'000'000'123'456'789);
  EXPECT_EQ(datagram->source_ip, 0xC0A801C9u);
  EXPECT_EQ(datagram->source_port, 2369);
  EXPECT_EQ(datagram->destination_port, 2368);
  EXPECT_FALSE(datagram->truncated);
  EXPECT_TRUE(std::ranges::equal(datagram->payload, payload));
  EXPECT_EQ(capture.next(), nullptr);
  EXPECT_EQ(capture.next(), nullptr);
  EXPECT_TRUE(capture.warnings().empty());
  EXPECT_EQ(capture.progress(), 1.0);
}

TEST(Capture, TwoLidarsInOneFileAreDistinguishedByPortAndAddress) {
  const TemporaryFile file{"two.pcap"};
  {
    PcapWriter writer = std::move(*PcapWriter::open(file.path()));
    for (std::int64_t i = 0; i < 10; ++i) {
      writer.write(stamp_from_ns(2 * i), {0xC0A801C9, 2368, 0xFFFFFFFF, 2368}, payload_of(1206));
      writer.write(stamp_from_ns(2 * i + 1), {0xC0A801CA, 2368, 0xFFFFFFFF, 2369}, payload_of(1206));
    }
  }
  Capture capture = opened(file.path());
  std::map<std::pair<std::uint32_t, std::uint16_t>, int> seen;
  while (const Datagram* datagram = capture.next()) {
    ++seen[{datagram->source_ip, datagram->destination_port}];
  }
  const std::map<std::pair<std::uint32_t, std::uint16_t>, int> expected{{{0xC0A801C9, 2368}, 10},
                                                                        {{0xC0A801CA, 2369}, 10}};
  EXPECT_EQ(seen, expected);
}

TEST(Capture, EveryLinkTypeOfTheContractGivesTheSamePayload) {
  const Bytes payload = payload_of(100);
  const Bytes packet = ipv4_udp({}, payload);
  const auto behind = [&](std::initializer_list<std::pair<std::uint64_t, int>> fields) {
    Bytes frame;
    for (const auto& [value, count] : fields) {
      append_big_endian(frame, value, count);
    }
    append(frame, packet);
    return frame;
  };
  Bytes vlan;
  append_big_endian(vlan, 0x81000005, 4);
  Bytes qinq;
  append_big_endian(qinq, 0x88A8006481000005, 8);

  EXPECT_EQ(payload_in(DLT_EN10MB, ethernet(packet)), payload);
  EXPECT_EQ(payload_in(DLT_EN10MB, ethernet(packet, 0x0800, vlan)), payload);
  EXPECT_EQ(payload_in(DLT_EN10MB, ethernet(packet, 0x0800, qinq)), payload);
  EXPECT_EQ(payload_in(DLT_LINUX_SLL, behind({{0, 8}, {0, 6}, {0x0800, 2}})), payload);
  EXPECT_EQ(payload_in(DLT_LINUX_SLL, behind({{0, 8}, {0, 6}, {0x8100, 2}, {5, 2}, {0x0800, 2}})), payload);
  EXPECT_EQ(payload_in(DLT_LINUX_SLL2, behind({{0x0800, 2}, {0, 8}, {0, 8}, {0, 2}})), payload);
  EXPECT_EQ(payload_in(DLT_NULL, behind({{0x02000000, 4}})), payload);
  EXPECT_EQ(payload_in(DLT_NULL, behind({{0x00000002, 4}})), payload);
  EXPECT_EQ(payload_in(DLT_LOOP, behind({{0x00000002, 4}})), payload);
  EXPECT_EQ(payload_in(DLT_RAW, packet), payload);
  EXPECT_EQ(payload_in(DLT_IPV4, packet), payload);
}

TEST(Capture, IpOptionsAndEthernetPaddingAreNotPayload) {
  const Bytes payload = payload_of(3);
  Bytes padded = ethernet(ipv4_udp({}, payload));
  padded.resize(60);
  EXPECT_EQ(payload_in(DLT_EN10MB, padded), payload);
  const Bytes options(40, std::byte{1}); // maximum length, all no-operations
  EXPECT_EQ(payload_in(DLT_EN10MB, ethernet(ipv4_udp({}, payload, options))), payload);
}

TEST(Capture, FramesWithoutIpv4UdpAreCountedByKind) {
  Bytes ipv6(60);
  ipv6[0] = std::byte{0x60};
  Bytes tcp = ipv4_udp({}, payload_of(20));
  tcp[9] = std::byte{6};
  EXPECT_EQ(stats_after(ethernet(payload_of(46), 0x0806)).not_ip, 1u); // ARP
  EXPECT_EQ(stats_after(ethernet(payload_of(46), 46)).not_ip, 1u);     // a length: IEEE 802.3
  EXPECT_EQ(stats_after(ethernet(ipv6, 0x86DD)).ipv6, 1u);
  EXPECT_EQ(stats_after(ethernet(tcp)).not_udp, 1u);
  EXPECT_EQ(stats_after({}).malformed, 1u);

  const Expected<Datagram, FrameError> raw = udp_datagram(DLT_RAW, ipv6, ipv6.size());
  ASSERT_FALSE(raw);
  EXPECT_EQ(raw.error(), FrameError::ipv6);
}

/// Splits an IP packet into fragments of this many payload bytes.
std::vector<Bytes> fragments_of(const Bytes& packet, std::size_t bytes, std::uint16_t id) {
  constexpr std::size_t kHeader = 20;
  std::vector<Bytes> fragments;
  for (std::size_t at = kHeader; at < packet.size(); at += bytes) {
    const std::size_t end = std::min(packet.size(), at + bytes);
    Bytes fragment{packet.begin(), packet.begin() + kHeader};
    fragment.insert(fragment.end(), packet.begin() + static_cast<std::ptrdiff_t>(at),
                    packet.begin() + static_cast<std::ptrdiff_t>(end));
    const std::size_t more = end < packet.size() ? 0x2000 : 0;
    fragment = with_16(fragment, 2, static_cast<std::uint16_t>(fragment.size()));
    fragment = with_16(fragment, 4, id);
    fragments.push_back(with_16(fragment, 6, static_cast<std::uint16_t>(more | (at - kHeader) / 8)));
  }
  return fragments;
}

TEST(Capture, FragmentsAreJoinedInAnyOrder) {
  const TemporaryFile file{"joined.pcap"};
  const Bytes payload = payload_of(8448), other = payload_of(3392);
  const auto first = fragments_of(ipv4_udp({}, payload), 1480, 7), second = fragments_of(ipv4_udp({}, other), 1480, 8);
  ASSERT_EQ(first.size(), 6U);
  ASSERT_EQ(second.size(), 3U);
  {
    PcapWriter writer = std::move(*PcapWriter::open(file.path()));
    std::int64_t ns = 0;
    for (const std::size_t i : {5U, 0U, 3U, 1U}) // two packets interleaved, the last fragment first
      writer.write_frame(stamp_from_ns(++ns), ethernet(first[i]));
    for (const Bytes& fragment : second)
      writer.write_frame(stamp_from_ns(++ns), ethernet(fragment));
    writer.write_frame(stamp_from_ns(++ns), ethernet(first[2]));
    writer.write_frame(stamp_from_ns(++ns), ethernet(first[4]));
    for (const Bytes& fragment : first) // same identification again
      writer.write_frame(stamp_from_ns(++ns), ethernet(fragment));
  }
  Capture capture = opened(file.path());
  for (const auto& [bytes, ns] : {std::pair{&other, 7}, std::pair{&payload, 9}, std::pair{&payload, 15}}) {
    const Datagram* datagram = capture.next();
    ASSERT_NE(datagram, nullptr);
    EXPECT_TRUE(std::ranges::equal(datagram->payload, *bytes));
    EXPECT_EQ(to_ns(datagram->receive_stamp), ns);
    EXPECT_FALSE(datagram->truncated);
  }
  EXPECT_EQ(capture.next(), nullptr);
  EXPECT_EQ(capture.stats().datagrams, 3U);
  EXPECT_EQ(capture.stats().fragments, 12U);
  EXPECT_TRUE(capture.warnings().empty());
}

TEST(Capture, LostFragmentsDoNotBlockOtherPackets) {
  const TemporaryFile file{"lost.pcap"};
  const Bytes payload = payload_of(4000);
  {
    PcapWriter writer = std::move(*PcapWriter::open(file.path()));
    for (std::uint16_t id = 0; id < 100; ++id) {
      auto fragments = fragments_of(ipv4_udp({}, payload), 1480, id);
      if (id % 10 != 0)
        fragments.erase(fragments.begin() + id % 3);
      for (const Bytes& fragment : fragments)
        writer.write_frame(stamp_from_ns(id), ethernet(fragment));
    }
    Bytes cut = fragments_of(ipv4_udp({}, payload), 1480, 200)[0];
    writer.write_frame(stamp_from_ns(200), ethernet(cut), 500);
    for (std::size_t length = 0; length < cut.size(); length += 13)
      writer.write_frame(stamp_from_ns(201), ethernet(Bytes{cut.begin(), cut.begin() + static_cast<long>(length)}));
  }
  Capture capture = opened(file.path());
  int datagrams = 0;
  while (const Datagram* datagram = capture.next()) {
    EXPECT_TRUE(std::ranges::equal(datagram->payload, payload));
    ++datagrams;
  }
  EXPECT_EQ(datagrams, 10);
  ASSERT_EQ(capture.warnings().size(), 2U);
  EXPECT_TRUE(contains(capture.warnings()[0], "IP fragments without the others of their packet"))
      << capture.warnings()[0];
}

TEST(Capture, IncompleteFragmentsAreReportedWithTheRemedy) {
  const TemporaryFile file{"fragments.pcap"};
  {
    const Bytes packet = ipv4_udp({}, payload_of(100));
    PcapWriter writer = std::move(*PcapWriter::open(file.path()));
    writer.write_frame(stamp_from_ns(1), ethernet(with_16(packet, 6, 0x2000))); // first: more fragments
    writer.write_frame(stamp_from_ns(2), ethernet(with_16(packet, 6, 0x000D))); // last: offset
    writer.write_frame(stamp_from_ns(3), ethernet(packet));
  }
  Capture capture = opened(file.path());
  const Datagram* datagram = capture.next();
  ASSERT_NE(datagram, nullptr);
  EXPECT_EQ(to_ns(datagram->receive_stamp), 3);
  EXPECT_EQ(capture.stats().fragments, 2u);
  ASSERT_EQ(capture.warnings().size(), 1u);
  EXPECT_TRUE(contains(capture.warnings()[0], "2 IP fragments without the others")) << capture.warnings()[0];
  EXPECT_TRUE(contains(capture.warnings()[0], "tcpdump -s 0 udp")) << capture.warnings()[0];
}

TEST(Capture, WrongLengthsAreMalformed) {
  const Bytes packet = ipv4_udp({}, payload_of(100)); // 20 + 8 + 100 bytes
  const auto ip_header_words = [&](std::uint8_t words) {
    Bytes lying = packet;
    lying[0] = static_cast<std::byte>(0x40 | words);
    return ethernet(lying);
  };
  EXPECT_EQ(stats_after(ip_header_words(4)).malformed, 1u);
  EXPECT_EQ(stats_after(ip_header_words(15)).malformed, 1u); // implies an impossible payload length
  EXPECT_EQ(stats_after(ethernet(with_16(packet, 2, 19))).malformed, 1u);
  EXPECT_EQ(stats_after(ethernet(with_16(packet, 2, 27))).malformed, 1u);   // no room for the UDP header
  EXPECT_EQ(stats_after(ethernet(with_16(packet, 24, 109))).malformed, 1u); // UDP longer than IP
  EXPECT_EQ(stats_after(ethernet(with_16(packet, 24, 7))).malformed, 1u);
  EXPECT_EQ(stats_after(ethernet(with_16(packet, 24, 0))).malformed, 1u);
  EXPECT_EQ(stats_after(ethernet(with_16(packet, 0, 0x5500))).malformed, 1u); // IP version 5
  EXPECT_EQ(stats_after(ethernet(with_16(packet, 24, 8))).datagrams, 1u);     // empty, but a datagram
}

/// A VLP-16 of 2014 sends position packets whose IP header claims the 1234 bytes of a data packet; the UDP length is
/// correct.
TEST(Capture, IpLengthBeyondTheFrameIsAcceptedIfTheUdpLengthFits) {
  const Bytes payload = payload_of(512);
  const Bytes packet = with_16(ipv4_udp({}, payload), 2, 1234);
  EXPECT_EQ(payload_in(DLT_EN10MB, ethernet(packet)), payload);
  EXPECT_EQ(stats_after(ethernet(packet)).truncated, 0u);
  EXPECT_EQ(stats_after(ethernet(with_16(packet, 24, 521))).malformed, 1u); // longer than the frame
}

TEST(Capture, SnapLengthMarksDatagramsTruncatedAndWarns) {
  const Bytes frame = ethernet(ipv4_udp({}, payload_of(1206)));
  constexpr std::size_t kHeaders = 14 + 20 + 8;
  for (const std::size_t snap_length : {std::size_t{20}, kHeaders - 1, kHeaders, kHeaders + 500, kHeaders + 1205}) {
    const TemporaryFile file{"snap.pcap"};
    { PcapWriter::open(file.path())->write_frame(stamp_from_ns(1), frame, snap_length); }
    Capture capture = opened(file.path());
    const Datagram* datagram = capture.next();
    if (snap_length < kHeaders) {
      EXPECT_EQ(datagram, nullptr);
      EXPECT_EQ(capture.stats().malformed, 1u);
      continue;
    }
    ASSERT_NE(datagram, nullptr);
    EXPECT_TRUE(datagram->truncated);
    EXPECT_EQ(datagram->payload.size(), snap_length - kHeaders);
    ASSERT_EQ(capture.warnings().size(), 1u);
    EXPECT_TRUE(contains(capture.warnings()[0], "snap length"));
  }
}

TEST(Capture, FileCutAtAnyByteIsReadUpToTheCut) {
  constexpr std::size_t kFileHeader = 24;
  constexpr std::size_t kRecord = 16 + 14 + 20 + 8 + 30;
  const TemporaryFile file{"whole.pcap"};
  {
    PcapWriter writer = std::move(*PcapWriter::open(file.path()));
    for (int i = 0; i < 3; ++i) {
      writer.write(stamp_from_ns(i), {1, 2368, 2, 2368}, payload_of(30));
    }
  }
  const Bytes whole = file.read();
  ASSERT_EQ(whole.size(), kFileHeader + 3 * kRecord);
  for (std::size_t size = 0; size <= whole.size(); ++size) {
    SCOPED_TRACE(size);
    file.write(std::span{whole}.first(size));
    if (size < kFileHeader) {
      EXPECT_TRUE(contains(error_of(Capture::open(file.path())), "whole.pcap: "));
      continue;
    }
    Capture capture = opened(file.path());
    while (capture.next() != nullptr) {
    }
    EXPECT_EQ(capture.stats().datagrams, (size - kFileHeader) / kRecord);
    const std::vector<std::string> warnings = capture.warnings();
    if ((size - kFileHeader) % kRecord == 0) {
      EXPECT_TRUE(warnings.empty());
    } else {
      ASSERT_EQ(warnings.size(), 1u);
      EXPECT_TRUE(contains(warnings[0], "byte " + std::to_string(size) + ": the capture ends in mid-packet"))
          << warnings[0];
    }
  }
}

/// Some recorders write nanoseconds under the header of a file of microseconds: a second lasted a thousand.
TEST(Capture, NanosecondsInAFileOfMicrosecondsAreReadAsSuch) {
  const Bytes frame = ethernet(ipv4_udp({}, payload_of(31)));
  const auto capture_with = [&](const std::vector<std::uint32_t>& fractions) {
    Bytes file;
    append_little_endian(file, 0xA1B2C3D4, 4);
    append_little_endian(file, 2, 2);
    append_little_endian(file, 4, 2);
    append_little_endian(file, 0, 8);
    append_little_endian(file, 65535, 4);
    append_little_endian(file, DLT_EN10MB, 4);
    for (const std::uint32_t fraction : fractions) {
      append_little_endian(file, 1'700'000'000, 4);
      append_little_endian(file, fraction, 4);
      append_little_endian(file, frame.size(), 4);
      append_little_endian(file, frame.size(), 4);
      append(file, frame);
    }
    return file;
  };
  const auto read = [&](const std::vector<std::uint32_t>& fractions, std::size_t warnings) {
    const TemporaryFile file{"ns.pcap", capture_with(fractions)};
    Capture capture = opened(file.path());
    std::vector<std::int64_t> ns;
    while (const Datagram* datagram = capture.next()) {
      ns.push_back(to_ns(datagram->receive_stamp) - 1'700'000'000'000'000'000);
    }
    EXPECT_EQ(capture.warnings().size(), warnings);
    return ns;
  };
  EXPECT_EQ(read({123'456'789, 124'783'893, 500, 999'999'999}, 1),
            (std::vector<std::int64_t>{123'456'789, 124'783'893, 500, 999'999'999}));
  EXPECT_EQ(read({123'456, 124'783, 123'456'789, 125'000}, 1),
            (std::vector<std::int64_t>{123'456'000, 124'783'000, 125'000'000}))
      << "one damaged time in a sound file";
}

TEST(Capture, DamageInTheMiddleLeavesThePrecedingPackets) {
  const TemporaryFile file{"damaged.pcap"};
  {
    PcapWriter writer = std::move(*PcapWriter::open(file.path()));
    for (int i = 0; i < 3; ++i) {
      writer.write(stamp_from_ns(i), {1, 2368, 2, 2368}, payload_of(30));
    }
  }
  Bytes content = file.read();
  std::fill_n(content.begin() + 24 + 88 + 8, 8, std::byte{0xFF}); // both lengths of the second record
  file.write(content);
  Capture capture = opened(file.path());
  EXPECT_NE(capture.next(), nullptr);
  EXPECT_EQ(capture.next(), nullptr);
  ASSERT_EQ(capture.warnings().size(), 1u);
  EXPECT_TRUE(contains(capture.warnings()[0], "the capture is damaged")) << capture.warnings()[0];
}

TEST(Capture, OtherFileTypesAreIdentified) {
  const auto error_with = [](const std::string& name, const Bytes& content) {
    const TemporaryFile file{name, content};
    return error_of(Capture::open(file.path()));
  };
  const std::string png = error_with("lidar.pcap", test::bytes_of("\x89PNG\r\n\x1a\n and so on and so on"));
  EXPECT_TRUE(contains(png, "lidar.pcap: a PNG image, not a pcap or pcapng capture; record one")) << png;
  const std::string empty = error_with("empty.pcap", {});
  EXPECT_TRUE(contains(empty, "empty.pcap: the file is empty (0 bytes); record one")) << empty;
  const std::string text = error_with("notes.txt", test::bytes_of("These are not the packets you are looking for.\n"));
  EXPECT_TRUE(contains(text, "notes.txt: a text file, not a pcap")) << text;
  const std::string gzip = error_with("lidar.pcap.gz", test::bytes_of("\x1F\x8B\x08 and so on and so on and so on"));
  EXPECT_TRUE(contains(gzip, "unpack it with: gzip -dc <")) << gzip;
  const std::string cut = error_with("cut.pcap", test::bytes_of("\xD4\xC3\xB2\xA1\x02"));
  EXPECT_TRUE(contains(cut, "a capture whose header is damaged")) << cut;
  EXPECT_TRUE(contains(error_of(Capture::open("/no/such/file.pcap")), "/no/such/file.pcap: No such file"))
      << "missing file";
  EXPECT_TRUE(contains(error_of(Capture::open(testing::TempDir())), "a folder, not a capture"));
}

TEST(Capture, ForeignLinkTypeIsNamed) {
  const TemporaryFile file{"wifi.pcap"};
  PcapWriter::open(file.path(), DLT_IEEE802_11);
  const std::string error = error_of(Capture::open(file.path()));
  EXPECT_TRUE(contains(error, "link type IEEE802_11 (105) is not supported")) << error;
}

TEST(Capture, RandomBytesNeverCrashAndEveryFrameIsAccountedFor) {
  std::mt19937 random{1};
  const auto random_bytes = [&](std::size_t size) {
    Bytes bytes(size);
    std::ranges::generate(bytes, [&] { return static_cast<std::byte>(random() & 0xFF); });
    return bytes;
  };
  const TemporaryFile file{"random.pcap"};
  for (int i = 0; i < 200; ++i) {
    file.write(random_bytes(random() % 3000));
    EXPECT_NE(error_of(Capture::open(file.path())), "") << "random bytes passed for a capture";
  }
  for (const int link_type : {DLT_EN10MB, DLT_LINUX_SLL, DLT_LINUX_SLL2, DLT_NULL, DLT_LOOP, DLT_RAW, DLT_IPV4}) {
    constexpr std::uint64_t kFrames = 500;
    {
      PcapWriter writer = std::move(*PcapWriter::open(file.path(), link_type));
      for (std::uint64_t i = 0; i < kFrames; ++i) {
        writer.write_frame(stamp_from_ns(1), random_bytes(random() % 100), 1 + random() % 100);
      }
    }
    Capture capture = opened(file.path());
    while (capture.next() != nullptr) {
    }
    const Capture::Stats& s = capture.stats();
    EXPECT_EQ(s.frames, kFrames);
    EXPECT_EQ(s.datagrams + s.not_ip + s.ipv6 + s.fragments + s.not_udp + s.malformed, kFrames);
  }
}

/// Every single-byte corruption of a valid frame: no crash, no payload outside the frame.
TEST(Capture, CorruptedHeadersNeverReachBeyondTheFrame) {
  const Bytes good = ethernet(ipv4_udp({}, payload_of(50)));
  for (std::size_t at = 0; at < 14 + 20 + 8; ++at) {
    for (unsigned value = 0; value < 256; ++value) {
      Bytes frame = good;
      frame[at] = static_cast<std::byte>(value);
      const Expected<Datagram, FrameError> datagram = udp_datagram(DLT_EN10MB, frame, frame.size());
      if (datagram && !datagram->payload.empty()) {
        EXPECT_GE(datagram->payload.data(), frame.data());
        EXPECT_LE(datagram->payload.data() + datagram->payload.size(), frame.data() + frame.size());
        EXPECT_FALSE(datagram->truncated);
      }
    }
  }
}

struct RealCapture {
  const char* file;
  int data_packets;
  int position_packets;
};

class RealCaptures : public testing::TestWithParam<RealCapture> {};

TEST_P(RealCaptures, HaveTheDocumentedNumberOfPackets) {
  const std::filesystem::path file = test::test_data() / "velodyne" / GetParam().file;
  if (!std::filesystem::exists(file)) {
    GTEST_SKIP() << file << " is not here; set LOCUS_TEST_DATA";
  }
  Capture capture = opened(file);
  int data_packets = 0;
  int position_packets = 0;
  Stamp last{};
  while (const Datagram* datagram = capture.next()) {
    data_packets += datagram->payload.size() == 1206 && datagram->destination_port == 2368 ? 1 : 0;
    position_packets += datagram->payload.size() == 512 && datagram->destination_port == 8308 ? 1 : 0;
    EXPECT_GE(datagram->receive_stamp, last);
    last = datagram->receive_stamp;
  }
  EXPECT_EQ(data_packets, GetParam().data_packets);
  EXPECT_EQ(position_packets, GetParam().position_packets);
  EXPECT_EQ(capture.stats().frames, capture.stats().datagrams);
  EXPECT_EQ(capture.progress(), 1.0);
  EXPECT_TRUE(capture.warnings().empty());
}

INSTANTIATE_TEST_SUITE_P(Velodyne, RealCaptures,
                         testing::Values(RealCapture{"hdl32e_moving_15mps.pcap", 876, 100},
                                         RealCapture{"hdl32e_static_monterey.pcap", 2702, 299},
                                         RealCapture{"vlp16_static_1200rpm_product21.pcap", 1902, 367},
                                         RealCapture{"vlp16_static_gps_pps.pcap", 293, 57}),
                         [](const auto& parameter) {
                           const std::string name = parameter.param.file;
                           return name.substr(0, name.find('.'));
                         });

} // namespace
} // namespace locus

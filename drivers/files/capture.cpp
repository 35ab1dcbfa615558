// SPDX-License-Identifier: Apache-2.0
#include "drivers/files/capture.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cstdio>
#include <optional>
#include <string_view>
#include <system_error>

#include <fmt/format.h>
#include <pcap/pcap.h>

#include "drivers/files/udp_frame.hpp"

namespace locus {
namespace {

using FilePointer = std::unique_ptr<std::FILE, decltype([](std::FILE* file) { std::fclose(file); })>;

constexpr std::string_view kRecordOne = "record one with: tcpdump -s 0 -w lidar.pcap udp";

struct Signature {
  std::string_view start;
  std::string_view what;
  std::string_view unpacker =
      {}; ///< a command that unpacks it from standard input to standard output; empty: none does
};

/// What people hand over in place of a capture.
constexpr std::array kForeignFiles{
    Signature{"\x89PNG", "a PNG image"},
    Signature{"\xFF\xD8\xFF", "a JPEG image"},
    Signature{"\x1F\x8B", "a gzip-compressed file", "gzip -dc"},
    Signature{"\xFD"
              "7zXZ",
              "an xz-compressed file", "xz -dc"},
    Signature{"BZh", "a bzip2-compressed file", "bzip2 -dc"},
    Signature{"\x28\xB5\x2F\xFD", "a zstd-compressed file", "zstd -dc"},
    Signature{"PK\x03\x04", "a zip archive", "funzip"},
    Signature{"#ROSBAG", "a ROS 1 bag"},
    Signature{"SQLite format 3", "an SQLite database (a ROS 2 bag?)"},
    Signature{"\x89MCAP", "an MCAP file"},
    Signature{"# .PCD", "a point cloud"},
};

constexpr std::array<std::string_view, 6> kCaptureMagics{"\xD4\xC3\xB2\xA1", "\xA1\xB2\xC3\xD4", "\x4D\x3C\xB2\xA1",
                                                         "\xA1\xB2\x3C\x4D", "\x0A\x0D\x0D\x0A", "\x34\xCD\xB2\xA1"};

/// What a file is that libpcap cannot read, judged by its first bytes; libpcap's own words where it is a capture.
std::string foreign_file(std::FILE* file, const std::filesystem::path& name, std::string_view libpcap_says) {
  if (std::fseek(file, 0, SEEK_SET) != 0) { // a pipe
    return fmt::format("not a pcap or pcapng capture ({})", libpcap_says);
  }
  std::array<char, 64> buffer{};
  const std::string_view start{buffer.data(), std::fread(buffer.data(), 1, buffer.size(), file)};
  const auto starts_with = [&](std::string_view magic) { return start.substr(0, magic.size()) == magic; };
  if (start.empty()) {
    return fmt::format("the file is empty (0 bytes); {}", kRecordOne);
  }
  if (std::any_of(kCaptureMagics.begin(), kCaptureMagics.end(), starts_with)) {
    return fmt::format("a capture whose header is damaged ({}); copy or record it again", libpcap_says);
  }
  const auto is_plain = [](unsigned char c) { return std::isprint(c) != 0 || std::isspace(c) != 0; };
  const bool is_text = std::all_of(start.begin(), start.end(), is_plain);
  Signature found{"", is_text ? "a text file" : "unknown binary data"};
  for (const Signature& signature : kForeignFiles) {
    found = starts_with(signature.start) ? signature : found;
  }
  return fmt::format("{}, not a pcap or pcapng capture; {}", found.what,
                     found.unpacker.empty()
                         ? kRecordOne
                         : fmt::format("unpack it with: {0} <{1} >{1}.unpacked", found.unpacker, name.string()));
}

std::string link_type_name(int link_type) {
  const char* name = pcap_datalink_val_to_name(link_type);
  return fmt::format("{} ({})", name != nullptr ? name : "unnamed", link_type);
}

void count(FrameError error, Capture::Stats& stats) {
  switch (error) {
  case FrameError::not_ip:
    ++stats.not_ip;
    return;
  case FrameError::ipv6:
    ++stats.ipv6;
    return;
  case FrameError::fragment:
    ++stats.fragments;
    return;
  case FrameError::not_udp:
    ++stats.not_udp;
    return;
  case FrameError::malformed:
    ++stats.malformed;
    return;
  }
}

/// Empty when the time is none to reckon with: a pcapng file may claim any 64-bit number of seconds.
std::optional<Stamp> stamp_of(const pcap_pkthdr& header) {
  constexpr std::int64_t kMaxSeconds = kLatestStamp.time_since_epoch() / std::chrono::seconds{1};
  if (header.ts.tv_sec < 0 || header.ts.tv_sec >= kMaxSeconds) {
    return std::nullopt;
  }
  return stamp_from_ns(header.ts.tv_sec * 1'000'000'000 + header.ts.tv_usec); // nanoseconds, as asked for in open()
}

} // namespace

void Capture::Closer::operator()(pcap* handle) const { pcap_close(handle); }

Capture::Capture(std::filesystem::path file, pcap* handle, std::uint64_t bytes_total)
    : file_(std::move(file)), pcap_(handle), bytes_total_(bytes_total) {}

Expected<Capture, std::string> Capture::open(const std::filesystem::path& file) {
  std::error_code ignored;
  if (std::filesystem::is_directory(file, ignored)) {
    return fmt::format("{}: a folder, not a capture; name the pcap file in it", file.string());
  }
  FilePointer stream{file == "-" ? stdin : std::fopen(file.c_str(), "rb")};
  if (!stream) {
    return fmt::format("{}: {}; check the path", file.string(), std::generic_category().message(errno));
  }
  std::array<char, PCAP_ERRBUF_SIZE> reason{};
  pcap_t* handle = pcap_fopen_offline_with_tstamp_precision(stream.get(), PCAP_TSTAMP_PRECISION_NANO, reason.data());
  if (handle == nullptr) {
    return fmt::format("{}: {}", file.string(), foreign_file(stream.get(), file, reason.data()));
  }
  static_cast<void>(stream.release()); // pcap_close() closes it
  const std::uintmax_t bytes_total =
      std::filesystem::is_regular_file(file, ignored) ? std::filesystem::file_size(file, ignored) : 0;
  Capture capture{file, handle, bytes_total};
  if (const int link_type = pcap_datalink(handle); !link_type_supported(link_type)) {
    return fmt::format("{}: link type {} is not supported; record on the network card that the lidar is plugged into "
                       "(Ethernet, VLAN, Linux cooked, loopback and raw IP are read)",
                       file.string(), link_type_name(link_type));
  }
  return capture;
}

const Datagram* Capture::next() {
  while (break_.empty()) {
    pcap_pkthdr* header = nullptr;
    const u_char* data = nullptr;
    const int status = pcap_next_ex(pcap_.get(), &header, &data);
    if (status == PCAP_ERROR_BREAK) { // the regular end
      return nullptr;
    }
    if (status != 1) {
      note_break();
      return nullptr;
    }
    ++stats_.frames;
    const std::span<const std::byte> frame{reinterpret_cast<const std::byte*>(data), header->caplen};
    const Expected<Datagram, FrameError> datagram = udp_datagram(pcap_datalink(pcap_.get()), frame, header->len);
    const std::optional<Stamp> stamp = stamp_of(*header);
    if (!datagram || !stamp) {
      count(datagram ? FrameError::malformed : datagram.error(), stats_);
      continue;
    }
    ++stats_.datagrams;
    stats_.truncated += datagram->truncated ? 1u : 0u;
    datagram_ = *datagram;
    datagram_.receive_stamp = *stamp;
    return &datagram_;
  }
  return nullptr;
}

/// libpcap reports a file that is cut and one that is damaged alike; only the stream knows whether its end was reached.
void Capture::note_break() {
  const std::string_view why = pcap_geterr(pcap_.get());
  if (why.find("different from") != std::string_view::npos) {
    break_ = fmt::format("{}: it was recorded on several interfaces of different kinds, which libpcap does not read "
                         "({}); the {} frames before are used; record with: tcpdump -i CARD, of the lidar's card alone",
                         file_.string(), why, stats_.frames);
    return;
  }
  const bool cut = std::feof(pcap_file(pcap_.get())) != 0;
  const std::string place = bytes_total_ > 0 ? fmt::format("byte {}: ", bytes_read()) : ""; // a pipe counts none
  break_ = fmt::format("{}: {}{} ({}); the {} frames before it are used{}", file_.string(), place,
                       cut ? "the capture ends in mid-packet" : "the capture is damaged", why, stats_.frames,
                       cut ? "" : ", what follows is not");
}

std::string Capture::why_none() const {
  return fmt::format("no UDP datagram in {} frames; record next to the lidar with: tcpdump -s 0 -w lidar.pcap udp",
                     stats_.frames);
}

std::vector<std::string> Capture::warnings() const {
  std::vector<std::string> lines;
  if (!break_.empty()) {
    lines.push_back(break_);
  }
  const auto warn = [&](std::uint64_t count, std::string_view what) {
    if (count > 0) {
      lines.push_back(fmt::format("{}: {} {}", file_.string(), count, what));
    }
  };
  warn(stats_.fragments,
       "IP fragments refused: a lidar's packets fit one Ethernet frame, so something on the way (tunnel, "
       "router, Wi-Fi bridge) has a smaller MTU; set it to 1500 or record next to the lidar (an Ouster's do not fit: "
       "it is not decoded)");
  warn(stats_.truncated, "datagrams cut by the capture's snap length; record again with: tcpdump -s 0");
  warn(stats_.malformed, "frames with contradictory lengths, headers cut short or absurd times left out; "
                         "record again if the lidar's packets are among them");
  warn(stats_.ipv6, "IPv6 packets left out; Velodyne lidars send IPv4");
  return lines;
}

double Capture::progress() const {
  return bytes_total_ > 0 ? static_cast<double>(bytes_read()) / static_cast<double>(bytes_total_) : 0.0;
}

std::uint64_t Capture::bytes_read() const {
  return static_cast<std::uint64_t>(std::max<off_t>(0, ftello(pcap_file(pcap_.get()))));
}

} // namespace locus

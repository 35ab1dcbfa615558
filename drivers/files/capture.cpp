// SPDX-License-Identifier: Apache-2.0
#include "drivers/files/capture.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <optional>
#include <string_view>
#include <system_error>

#include <fmt/format.h>
#include <pcap/pcap.h>

#include "drivers/files/pcapng_reader.hpp"
#include "drivers/files/udp_frame.hpp"

namespace locus {
namespace {

constexpr std::string_view kRecordOne = "record one with: tcpdump -s 0 -w lidar.pcap udp";

struct Signature {
  std::string_view start;
  std::string_view what;
  std::string_view unpacker = {}; ///< command that decompresses from standard input to standard output, if any
};

/// File types commonly given instead of a capture.
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

constexpr std::string_view kPcapngMagic = "\x0A\x0D\x0D\x0A";

/// Describes a file that libpcap cannot read, judged by its first bytes; quotes libpcap's message if it is a capture.
std::string foreign_file(std::string_view start, const std::filesystem::path& name, std::string_view libpcap_says) {
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

} // namespace

/// Adapts a stream whose first bytes were already read to the FILE that libpcap requires.
struct Capture::Feed {
  explicit Feed(std::unique_ptr<ByteStream> from) : stream(std::move(from)) {
    std::size_t more = 1;
    for (; more > 0 && start_size < start.size(); start_size += more)
      more = stream->read(std::as_writable_bytes(std::span{start}.subspan(start_size)));
  }

  /// Opens a FILE that owns the feed. Returns nullptr and sets errno if memory is exhausted.
  static std::FILE* open(std::unique_ptr<Feed> feed) {
    constexpr std::size_t kBufferBytes = 1 << 16;
    std::FILE* const file = fopencookie(feed.get(), "rb", {read, nullptr, seek, close});
    if (file != nullptr) {
      static_cast<void>(feed.release());
      std::setvbuf(file, nullptr, _IOFBF, kBufferBytes);
    }
    return file;
  }

  static ssize_t read(void* cookie, char* out, std::size_t size) {
    auto& feed = *static_cast<Feed*>(cookie);
    std::size_t count = 0;
    if (feed.at < feed.start_size) {
      count = std::min(size, feed.start_size - feed.at);
      std::memcpy(out, feed.start.data() + feed.at, count);
    } else {
      count = feed.stream->read(std::as_writable_bytes(std::span{out, size}));
    }
    feed.at += count;
    return static_cast<ssize_t>(count);
  }
  /// Reports the current offset; no other seek is supported.
  static int seek(void* cookie, off64_t* offset, int whence) {
    if (whence != SEEK_CUR || *offset != 0) {
      errno = ESPIPE;
      return -1;
    }
    *offset = static_cast<off64_t>(static_cast<Feed*>(cookie)->at);
    return 0;
  }
  static int close(void* cookie) {
    delete static_cast<Feed*>(cookie);
    return 0;
  }

  std::unique_ptr<ByteStream> stream;
  std::array<char, 64> start{};
  std::size_t start_size = 0;
  std::uint64_t at = 0; ///< bytes read so far
};

void Capture::Closer::operator()(pcap* handle) const { pcap_close(handle); }

Capture::Capture(std::filesystem::path file, pcap* handle, std::unique_ptr<PcapngReader> pcapng,
                 const ByteStream& stream)
    : file_(std::move(file)), pcap_(handle), pcapng_(std::move(pcapng)), stream_(&stream) {}

Expected<Capture, std::string> Capture::open(const std::filesystem::path& file) {
  Expected<std::unique_ptr<ByteStream>, std::string> stream = open_stream(file);
  return stream ? open(std::move(*stream), file) : stream.error();
}

Expected<Capture, std::string> Capture::open(std::unique_ptr<ByteStream> stream, const std::filesystem::path& name) {
  auto feed = std::make_unique<Feed>(std::move(stream));
  const ByteStream& bytes = *feed->stream;
  const std::string start(feed->start.data(), feed->start_size);
  std::FILE* const opened = Feed::open(std::move(feed));
  if (opened == nullptr) {
    return fmt::format("{}: {}", name.string(), std::generic_category().message(errno));
  }
  const auto problem_of = [&](std::string_view reason) {
    const std::string problem = bytes.problem();
    return fmt::format("{}: {}", name.string(), problem.empty() ? foreign_file(start, name, reason) : problem);
  };
  if (start.starts_with(kPcapngMagic)) {
    auto reader = std::make_unique<PcapngReader>(opened);
    if (!reader->open()) {
      return problem_of(reader->problem());
    }
    return Capture{name, nullptr, std::move(reader), bytes};
  }
  std::array<char, PCAP_ERRBUF_SIZE> reason{};
  pcap_t* handle = pcap_fopen_offline_with_tstamp_precision(opened, PCAP_TSTAMP_PRECISION_NANO, reason.data());
  if (handle == nullptr) {
    std::string problem = problem_of(reason.data());
    std::fclose(opened);
    return problem;
  }
  Capture capture{name, handle, nullptr, bytes}; // pcap_close() closes the file
  if (const int link_type = pcap_datalink(handle); !link_type_supported(link_type)) {
    return fmt::format("{}: link type {} is not supported; record on the network card that the lidar is plugged into "
                       "(Ethernet, VLAN, Linux cooked, loopback and raw IP are read)",
                       name.string(), link_type_name(link_type));
  }
  return capture;
}

const Datagram* Capture::next() {
  while (const std::optional<CapturedFrame> frame = next_frame()) {
    ++stats_.frames;
    Expected<Datagram, FrameError> datagram = udp_datagram(frame->link_type, frame->bytes, frame->wire_bytes);
    if (!datagram && datagram.error() == FrameError::fragment) {
      if (const auto joined = fragments_.add(frame->link_type, frame->bytes)) {
        datagram = *joined;
      }
    }
    if (!link_type_supported(frame->link_type)) {
      foreign_link_type_ = frame->link_type;
    }
    if (!datagram || !frame->stamp) {
      count(datagram ? FrameError::malformed : datagram.error(), stats_);
      continue;
    }
    ++stats_.datagrams;
    stats_.truncated += datagram->truncated ? 1u : 0u;
    datagram_ = *datagram;
    datagram_.receive_stamp = *frame->stamp;
    return &datagram_;
  }
  return nullptr;
}

/// Returns the next frame; empty at the end, and where reading stops early.
std::optional<CapturedFrame> Capture::next_frame() {
  if (!break_.empty()) {
    return std::nullopt;
  }
  if (pcapng_ != nullptr) {
    const std::optional<CapturedFrame> frame = pcapng_->next();
    if (!frame && !pcapng_->problem().empty()) {
      note_break(pcapng_->file(), pcapng_->problem());
    }
    return frame;
  }
  pcap_pkthdr* header = nullptr;
  const u_char* data = nullptr;
  const int status = pcap_next_ex(pcap_.get(), &header, &data);
  if (status == PCAP_ERROR_BREAK) { // regular end
    return std::nullopt;
  }
  if (status != 1) {
    note_break(pcap_file(pcap_.get()), pcap_geterr(pcap_.get()));
    return std::nullopt;
  }
  return CapturedFrame{pcap_datalink(pcap_.get()),
                       {reinterpret_cast<const std::byte*>(data), header->caplen},
                       header->len,
                       stamp_of(header->ts)};
}

/// Returns the stamp; empty if it is out of range. Precondition: `time` is in nanoseconds, as requested in open().
///
/// Some recorders write nanoseconds into a file of microseconds, where libpcap multiplies them by a thousand: all but
/// one in a thousand are then beyond a second. A few of those in a sound file are damage.
std::optional<Stamp> Capture::stamp_of(const timeval& time) {
  constexpr std::int64_t kMaxSeconds = kLatestStamp.time_since_epoch() / std::chrono::seconds{1};
  constexpr std::int64_t kSecond_ns = 1'000'000'000, kFactor = 1'000;
  const bool is_beyond = time.tv_usec >= kSecond_ns;
  ++(is_beyond ? beyond_a_second_ : within_a_second_);
  const bool holds_ns = beyond_a_second_ > within_a_second_;
  const std::int64_t fraction_ns = holds_ns ? time.tv_usec / kFactor : time.tv_usec;
  if (time.tv_sec < 0 || time.tv_sec >= kMaxSeconds || fraction_ns < 0 || fraction_ns >= kSecond_ns) {
    return std::nullopt;
  }
  return stamp_from_ns(time.tv_sec * kSecond_ns + fraction_ns);
}

/// Records why reading stopped. Truncation and damage are reported alike; only the stream knows whether its end was
/// reached.
void Capture::note_break(std::FILE* file, std::string_view why) {
  const bool cut = std::feof(file) != 0;
  const std::string problem = stream_->problem(); // not empty: the stream, not the capture, ended early
  break_ = fmt::format("{}: byte {}: {} ({}); the {} frames before it are used{}", file_.string(), ftello(file),
                       cut ? "the capture ends in mid-packet" : "the capture is damaged",
                       problem.empty() ? why : problem, stats_.frames, cut ? "" : ", what follows is not");
}

std::string Capture::why_none() const {
  if (foreign_link_type_) {
    return fmt::format(
        "no UDP datagram in {} frames, and frames of link type {} are not read; record on the network card "
        "that the lidar is plugged into: tcpdump -i CARD -s 0 -w lidar.pcap udp",
        stats_.frames, link_type_name(*foreign_link_type_));
  }
  return fmt::format("no UDP datagram in {} frames; record next to the lidar with: tcpdump -s 0 -w lidar.pcap udp",
                     stats_.frames);
}

std::vector<std::string> Capture::warnings() const {
  std::vector<std::string> lines;
  if (!break_.empty()) {
    lines.push_back(break_);
  } else if (std::string problem = stream_->problem(); !problem.empty()) {
    lines.push_back(fmt::format("{}: {}; the {} frames before it are used", file_.string(), problem, stats_.frames));
  }
  if (beyond_a_second_ > within_a_second_) {
    lines.push_back(
        fmt::format("{}: its header promises microseconds, but its times hold nanoseconds; they are read as "
                    "such",
                    file_.string()));
  }
  const auto warn = [&](std::uint64_t count, std::string_view what) {
    if (count > 0) {
      lines.push_back(fmt::format("{}: {} {}", file_.string(), count, what));
    }
  };
  warn(stats_.fragments - fragments_.joined(),
       "IP fragments without the others of their packet; record next to the lidar, with: tcpdump -s 0 udp (a filter by "
       "port keeps back all but the first of each)");
  warn(stats_.truncated, "datagrams cut by the capture's snap length; record again with: tcpdump -s 0");
  warn(stats_.malformed, "frames with contradictory lengths, headers cut short or absurd times left out; "
                         "record again if the lidar's packets are among them");
  warn(stats_.ipv6, "IPv6 packets left out; Velodyne lidars send IPv4");
  return lines;
}

double Capture::progress() const { return stream_->progress(); }

} // namespace locus

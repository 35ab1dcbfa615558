// SPDX-License-Identifier: Apache-2.0
#include "drivers/net/flood_guard.hpp"

#include <algorithm>
#include <array>

#include <linux/filter.h>

namespace locus {

namespace {

/// Classic BPF program, assembled in order.
class Program {
 public:
  void load(std::uint16_t size, int offset) {
    add(static_cast<std::uint16_t>(BPF_LD | size | BPF_ABS), 0, 0, static_cast<std::uint32_t>(offset));
  }
  void keep_bits(std::uint32_t mask) { add(BPF_ALU | BPF_AND | BPF_K, 0, 0, mask); }
  /// Skips `if_equal` instructions if the loaded value equals `value`, otherwise `if_not`.
  void skip(std::uint32_t value, std::size_t if_equal, std::size_t if_not) {
    add(BPF_JMP | BPF_JEQ | BPF_K, static_cast<std::uint8_t>(if_equal), static_cast<std::uint8_t>(if_not), value);
  }
  void drop() { add(BPF_RET | BPF_K, 0, 0, 0); }
  void pass() { add(BPF_RET | BPF_K, 0, 0, UINT32_MAX); }
  std::span<sock_filter> steps() { return {steps_.data(), count_}; }

 private:
  void add(std::uint16_t code, std::uint8_t if_true, std::uint8_t if_false, std::uint32_t value) {
    steps_[count_++] = {code, if_true, if_false, value};
  }
  std::array<sock_filter, 16 + LidarRouter::Senders::kMax + LidarRouter::Senders::kMaxLengths> steps_{};
  std::size_t count_ = 0;
};

/// Builds a filter that passes datagrams from `senders` (from any if empty) with the length of a lidar packet, and one
/// in kSample of all others.
Program lidars_and_samples(std::span<const std::uint32_t> senders, std::span<const std::size_t> lengths) {
  constexpr std::size_t kSampleSteps = 4; ///< before the last instruction, which passes
  constexpr std::uint32_t kHeader = 8;    // size of the UDP header in bytes; offsets start there
  constexpr int kLengthInHeader = 4, kSourceInIpHeader = SKF_NET_OFF + 12;
  const std::size_t sender_steps = senders.empty() ? 0 : 1 + senders.size();
  const std::size_t if_length_fits = senders.empty() ? kSampleSteps : 0;
  Program program;
  program.load(BPF_H, kLengthInHeader);
  for (std::size_t left = lengths.size(); left > 0; --left)
    program.skip(kHeader + static_cast<std::uint32_t>(lengths[lengths.size() - left]), left - 1 + if_length_fits,
                 left == 1 ? sender_steps : 0);
  if (!senders.empty())
    program.load(BPF_W, kSourceInIpHeader);
  for (std::size_t left = senders.size(); left > 0; --left)
    program.skip(senders[left - 1], left - 1 + kSampleSteps, 0);
  program.load(BPF_W, SKF_AD_OFF + SKF_AD_RANDOM);
  program.keep_bits(FloodGuard::kSample - 1);
  program.skip(0, 1, 0);
  program.drop();
  program.pass();
  return program;
}

} // namespace

void FloodGuard::look_at(std::span<const Datagram> datagrams, UdpSocket& socket) {
  if (datagrams.empty())
    return;
  begin_second(datagrams.back().receive_stamp, socket);
  const auto foreign = std::ranges::count_if(datagrams, [this](const Datagram& one) { return is_foreign(one); });
  foreign_ += static_cast<std::uint64_t>(foreign) * (guards_ ? kSample : 1);
  if (!guards_ && foreign_ > kFlood)
    guard(socket);
}

void FloodGuard::advance(Stamp now, UdpSocket& socket) {
  if (guards_)
    begin_second(now, socket);
}

void FloodGuard::expect(const LidarRouter::Senders& senders, UdpSocket& socket) {
  if (senders == senders_)
    return;
  senders_ = senders;
  if (guards_)
    guard(socket);
}

void FloodGuard::guard(UdpSocket& socket) {
  guards_ = socket.filter(lidars_and_samples(senders_.all(), senders_.all_lengths()).steps());
}

/// Starts the next second if the current one is over.
void FloodGuard::begin_second(Stamp now, UdpSocket& socket) {
  if (std::chrono::abs(now - second_began_) <= std::chrono::seconds{1})
    return;
  if (guards_ && foreign_ < kFlood) {
    guards_ = false;
    socket.filter({});
  }
  second_began_ = now;
  foreign_ = 0;
}

bool FloodGuard::is_foreign(const Datagram& datagram) const {
  const auto known = senders_.all();
  const auto lengths = senders_.all_lengths();
  return std::ranges::find(lengths, datagram.payload.size()) == lengths.end() ||
         (!known.empty() && std::ranges::find(known, datagram.source_ip) == known.end());
}

} // namespace locus

// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/driver_stamps.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>

#include "drivers/packet_clock.hpp"

namespace locus::tools {
namespace {

constexpr Duration kLargestError = std::chrono::seconds{1};
constexpr Duration kLongestMessage = std::chrono::seconds{10};

bool has_stamps(const LidarPackets& packets) {
  return packets.packets.size() > 1 || packets.packets.front().stamp != Stamp{};
}

/// Returns whether the stamps of a message advance as the lidar's own clock does; without one, whether they advance.
bool advance(const LidarPackets& packets) {
  constexpr Duration kLongestDelay = std::chrono::milliseconds{80}; ///< of a packet in the driver
  const LidarPackets::Packet& first = packets.packets.front();
  const auto first_clock = clock_in(packets.payload(first), nullptr);
  const auto advances = [&](const LidarPackets::Packet& packet) {
    const Duration passed = packet.stamp - first.stamp;
    const auto clock = first_clock ? clock_in(packets.payload(packet), nullptr) : std::nullopt;
    if (!clock)
      return passed >= Duration{} && passed < kLongestMessage;
    return std::chrono::abs(passed - clock_advance(*first_clock, *clock)) < kLongestDelay;
  };
  const bool is_constant = packets.packets.size() > 1 && packets.packets.back().stamp == first.stamp;
  return first.stamp != Stamp{} && !is_constant && std::ranges::all_of(packets.packets, advances);
}

} // namespace

std::optional<Duration> recorder_ahead_of_driver(Bag& bag, std::size_t topic) {
  constexpr std::size_t kMessages = 9; ///< the median is right if up to four are wrong
  std::vector<Duration> ahead;
  std::size_t messages = 0;
  while (messages < kMessages) {
    const BagMessage* const message = bag.next();
    if (message == nullptr)
      break;
    const PacketType* const type = message->topic == topic ? packet_type(bag.topics()[topic].type) : nullptr;
    const auto packets =
        type != nullptr ? type->read({message->data, bag.topics()[topic].serialisation}) : std::nullopt;
    if (!packets || packets->packets.empty())
      continue;
    ++messages;
    if (advance(*packets))
      ahead.push_back(message->recorded - packets->packets.back().stamp);
  }
  bag.rewind();
  if (ahead.empty())
    return std::nullopt;
  const auto middle = ahead.begin() + static_cast<std::ptrdiff_t>(ahead.size() / 2);
  std::ranges::nth_element(ahead, middle);
  return *middle;
}

void DriverStamps::correct(LidarPackets& packets, Stamp recorded) {
  const Duration since_latest = latest_recorded_ ? recorded - *latest_recorded_ : Duration{};
  const bool clock_was_set = // of all, in the middle of the message
      since_latest < Duration{} || since_latest > kLargestError;
  latest_recorded_ = recorded;
  if (!are_usable(packets, recorded)) {
    replaced_ += has_stamps(packets) && !clock_was_set ? 1U : 0U;
    const Stamp end = recorded - recorder_ahead_.value_or(Duration{});
    const auto last = clock_in(packets.payload(packets.packets.back()), nullptr);
    for (LidarPackets::Packet& packet : packets.packets) {
      const auto clock = clock_in(packets.payload(packet), nullptr);
      const Duration before = clock && last ? clock_advance(*clock, *last) : Duration{};
      packet.stamp = end - std::clamp(before, Duration{}, kLongestMessage);
    }
  }
  latest_ = packets.packets.back().stamp;
}

bool DriverStamps::are_usable(const LidarPackets& packets, Stamp recorded) const {
  if (!recorder_ahead_ || !advance(packets))
    return false;
  const Stamp first = packets.packets.front().stamp, last = packets.packets.back().stamp;
  const bool continues = latest_ && first > *latest_ && first - *latest_ < kLargestError;
  return continues || std::chrono::abs(recorded - last - *recorder_ahead_) < kLargestError;
}

} // namespace locus::tools

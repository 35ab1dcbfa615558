// SPDX-License-Identifier: Apache-2.0
#include "drivers/velodyne/model_recognition.hpp"

#include <algorithm>
#include <cstdlib>

#include "drivers/wire.hpp"

namespace locus::velodyne {

namespace {

constexpr Duration kSpacingTolerance = std::chrono::microseconds{2}; // both stamps are integer microseconds
constexpr int kMaxLostInARow = 3;

/// Noise of a VLS-128 stamp difference relative to the mean spacing: at most 2.2 us in a recording.
constexpr Duration kStampNoise = std::chrono::microseconds{3};

bool is_close(Duration a, Duration b) { return std::chrono::abs(a - b) <= kSpacingTolerance; }

/// Returns the model that sends packets at this spacing; empty if none does.
std::optional<Model> model_of_spacing(Model claimed, ReturnMode mode, Duration spacing) {
  for (const Pace pace : {Pace::first, Pace::slower})
    for (int packets = 1; packets <= 1 + kMaxLostInARow; ++packets)
      if (is_close(spacing, packets * packet_duration(claimed, mode, pace)))
        return claimed;
  const auto* found = std::find_if(kModels.begin(), kModels.end(),
                                   [&](Model m) { return is_close(spacing, packet_duration(m, mode)); });
  return found == kModels.end() ? std::nullopt : std::optional{*found};
}

/// Returns true if the two halves of the blocks measure the same distances, as when 16 lasers fire twice. In recorded
/// packets, the threshold of 60 % of the pairs within 2 % is above all HDL-32E and below nine tenths of VLP-16 packets.
bool fires_sixteen_lasers_twice(std::span<const std::byte, kDataPacketBytes> packet) {
  constexpr std::size_t kLasers = 16;
  std::size_t pairs = 0;
  std::size_t alike = 0;
  for (std::size_t block = 0; block < kBlocks; ++block) {
    const std::byte* channels = packet.data() + block * kBlockBytes + kBlockHeaderBytes;
    for (std::size_t laser = 0; laser < kLasers; ++laser) {
      const int first = read_u16(channels + laser * kChannelBytes);
      const int second = read_u16(channels + (laser + kLasers) * kChannelBytes);
      if (first == 0 || second == 0)
        continue;
      ++pairs;
      if (50 * std::abs(first - second) <= std::max(first, second))
        ++alike;
    }
  }
  return 10 * alike > 6 * pairs;
}

} // namespace

Model ModelRecognition::recognise(Model claimed, ReturnMode mode, std::optional<Duration> spacing,
                                  std::span<const std::byte, kDataPacketBytes> packet) {
  if (claimed != claimed_)
    verdict_.reset();
  claimed_ = claimed;
  if (const auto spaced = spacing ? model_of_spacing(claimed, mode, *spacing) : std::nullopt)
    verdict_ = spaced;
  if (!verdict_)
    verdict_ = claimed == Model::hdl32e && fires_sixteen_lasers_twice(packet) ? Model::vlp16 : claimed;
  return *verdict_;
}

Pace PaceRecognition::recognise(Model model, ReturnMode mode, std::optional<Duration> spacing) {
  if (!has_two_paces(model))
    return pace_ = Pace::first;
  const Duration first = packet_duration(model, mode, Pace::first);
  const Duration slower = packet_duration(model, mode, Pace::slower);
  if (!spacing || *spacing < first - kStampNoise || *spacing > slower + kStampNoise) {
    beyond_middle_ = {};
    return pace_;
  }
  beyond_middle_ += *spacing - (first + slower) / 2;
  if (std::chrono::abs(beyond_middle_) > kStampNoise) {
    pace_ = beyond_middle_ > Duration{} ? Pace::slower : Pace::first;
    beyond_middle_ = {};
  }
  return pace_;
}

} // namespace locus::velodyne

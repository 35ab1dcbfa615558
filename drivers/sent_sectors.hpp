// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <bitset>
#include <cstddef>
#include <cstdint>

namespace locus {

/// Distinguishes lost packets from sectors that a lidar does not send because its field of view is restricted: in a gap
/// between packets, nothing is lost if no packet had its azimuths for many turns. Learns the sectors, one degree each,
/// from the packets, and adapts to a change of the view within twenty turns. Single owner, not thread-safe. Allocates
/// nothing.
class SentSectors {
 public:
  /// Adds the sectors of a packet that starts at `from_cdeg` and covers `turn_cdeg`. `turned_cdeg`: rotation since the
  /// preceding packet.
  void add(double from_cdeg, double turn_cdeg, double turned_cdeg);

  /// Returns how many of the packets missing between two azimuths are lost. During the first turns, while the sectors
  /// are unknown, these are all; withdraw_false_losses() corrects that.
  std::uint64_t lost_between(double from_cdeg, double to_cdeg, std::uint64_t missing);

  /// Returns, once, how many packets were counted as lost during the first turns although they were never sent.
  std::uint64_t withdraw_false_losses();

 private:
  struct Gap {
    double from_cdeg, to_cdeg;
    std::uint64_t missing;
  };

  [[nodiscard]] std::uint64_t lost_in(const Gap& gap) const;
  [[nodiscard]] bool knows_view() const;

  static constexpr std::size_t kSectors = 360;
  std::bitset<kSectors> sent_, sent_before_; ///< in the current period of turns and in the previous one
  double turned_cdeg_ = 0.0;                 ///< in the current period
  bool is_first_ = true;                     ///< the current period is the first
  std::array<Gap, 16> gaps_{};               ///< in the first turns
  std::size_t gap_count_ = 0;
};

} // namespace locus

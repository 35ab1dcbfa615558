// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <bitset>
#include <cstddef>
#include <cstdint>

namespace locus {

/// Tells lost packets from sectors that a lidar does not send, because its field of view is restricted: in a gap
/// between packets whose azimuths have not come for many turns, nothing is lost. Learns the sectors from the packets,
/// one degree each, and follows a change of the view within twenty turns. Single owner, not thread-safe. Allocates
/// nothing.
class SentSectors {
 public:
  /// Takes a packet with returns from an azimuth on, and how far the lidar has turned since the packet before it.
  void take(double from_cdeg, double turn_cdeg, double turned_cdeg);

  /// Returns how many of the packets missing between two azimuths are lost. The first turns do not tell, so all are
  /// then, and take_corrected() gives them back.
  std::uint64_t lost_between(double from_cdeg, double to_cdeg, std::uint64_t missing);

  /// Returns once how many packets were taken for lost in the first turns and were not sent.
  std::uint64_t take_corrected();

 private:
  struct Gap {
    double from_cdeg, to_cdeg;
    std::uint64_t missing;
  };

  [[nodiscard]] std::uint64_t lost_in(const Gap& gap) const;
  [[nodiscard]] bool knows_view() const;

  static constexpr std::size_t kSectors = 360;
  std::bitset<kSectors> sent_, sent_before_; ///< in the present turns, and in as many before them
  double turned_cdeg_ = 0.0;                 ///< in the present turns
  bool is_first_ = true;                     ///< the present turns are the first
  std::array<Gap, 16> gaps_{};               ///< of the first turns
  std::size_t gap_count_ = 0;
};

} // namespace locus

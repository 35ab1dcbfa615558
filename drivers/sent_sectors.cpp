// SPDX-License-Identifier: Apache-2.0
#include "drivers/sent_sectors.hpp"

#include <cmath>
#include <utility>

namespace locus {
namespace {

constexpr double kTurn_cdeg = 36'000.0, kSector_cdeg = 100.0;
constexpr double kTurnsInPeriod = 10.0, kTurnsToKnowTheView = 3.0;

} // namespace

void SentSectors::add(double from_cdeg, double turn_cdeg, double turned_cdeg) {
  const auto first = static_cast<std::size_t>(from_cdeg / kSector_cdeg);
  const auto last = static_cast<std::size_t>((from_cdeg + turn_cdeg) / kSector_cdeg);
  for (std::size_t sector = first; sector <= last && sector < first + kSectors; ++sector)
    sent_.set(sector % kSectors);
  turned_cdeg_ += turned_cdeg;
  if (turned_cdeg_ < kTurnsInPeriod * kTurn_cdeg)
    return;
  sent_before_ = std::exchange(sent_, {});
  turned_cdeg_ = 0.0;
  is_first_ = false;
}

bool SentSectors::knows_view() const { return !is_first_ || turned_cdeg_ >= kTurnsToKnowTheView * kTurn_cdeg; }

std::uint64_t SentSectors::lost_between(double from_cdeg, double to_cdeg, std::uint64_t missing) {
  const Gap gap{from_cdeg, to_cdeg, missing};
  if (knows_view())
    return lost_in(gap);
  if (gap_count_ < gaps_.size())
    gaps_[gap_count_++] = gap;
  return missing;
}

std::uint64_t SentSectors::withdraw_false_losses() {
  if (gap_count_ == 0 || !knows_view())
    return 0;
  const std::size_t count = std::exchange(gap_count_, 0);
  std::uint64_t corrected = 0;
  for (std::size_t i = 0; i < count; ++i)
    corrected += gaps_[i].missing - lost_in(gaps_[i]);
  return corrected;
}

/// Considers the sectors wholly within the gap: the share of them that is sent is the share of packets that are lost.
std::uint64_t SentSectors::lost_in(const Gap& gap) const {
  const double wide_cdeg = std::fmod(std::fmod(gap.to_cdeg - gap.from_cdeg, kTurn_cdeg) + kTurn_cdeg, kTurn_cdeg);
  const auto first = static_cast<std::size_t>(gap.from_cdeg / kSector_cdeg) + 1;
  const auto end = static_cast<std::size_t>((gap.from_cdeg + wide_cdeg) / kSector_cdeg);
  if (first >= end)
    return gap.missing;
  std::uint64_t sent = 0;
  for (std::size_t sector = first; sector < end; ++sector)
    sent += sent_.test(sector % kSectors) || sent_before_.test(sector % kSectors) ? 1U : 0U;
  return (2 * gap.missing * sent + (end - first)) / (2 * (end - first)); // rounded
}

} // namespace locus

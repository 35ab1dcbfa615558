// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "drivers/velodyne/model.hpp"

namespace locus {

/// Latest packets of one lidar, to recognise duplicates. Compares all of a Velodyne packet, the beginning of longer
/// ones. All packets of a lidar have the same length. Single owner, not thread-safe. Allocates nothing.
class RecentPackets {
 public:
  [[nodiscard]] bool contains(std::span<const std::byte> payload) const;
  void add(std::span<const std::byte> payload);

 private:
  using Beginning = std::array<std::byte, velodyne::kDataPacketBytes>;
  std::array<Beginning, 8> packets_{};
  std::size_t count_ = 0; ///< added so far
};

} // namespace locus

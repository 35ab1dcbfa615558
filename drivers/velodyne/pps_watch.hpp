// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string_view>

#include "core/base/stamp.hpp"
#include "drivers/velodyne/position_packet.hpp"

namespace locus::velodyne {

/// Finds out whether a locked PPS stays unused. A receiver sends a good sentence among bad ones, and a bad one among
/// good ones: either state counts once it has lasted for five seconds. Single owner, not thread-safe.
class PpsWatch {
 public:
  /// Adds a position packet.
  void add(const PositionPacket& packet, Stamp receive);

  /// Says why the PPS has not been used for more than five seconds; empty if it is used or not locked. Static lifetime.
  [[nodiscard]] std::string_view why_unused(Stamp now) const;

 private:
  std::string_view unused_for_; ///< reason of the last packet whose PPS was not used
  Stamp unused_since_;
  std::optional<Stamp> used_since_; ///< empty while it is not used
};

} // namespace locus::velodyne

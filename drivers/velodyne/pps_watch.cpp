// SPDX-License-Identifier: Apache-2.0
#include "drivers/velodyne/pps_watch.hpp"

#include <utility>

namespace locus::velodyne {
namespace {

constexpr Duration kLasts = std::chrono::seconds{5};

} // namespace

void PpsWatch::add(const PositionPacket& packet, Stamp receive) {
  const std::string_view why = velodyne::why_unused(packet);
  if (why.empty())
    used_since_ = used_since_.value_or(receive);
  else if (used_since_.reset(); why != std::exchange(unused_for_, why))
    unused_since_ = receive;
  if (used_since_ && receive - *used_since_ > kLasts)
    unused_for_ = {};
}

std::string_view PpsWatch::why_unused(Stamp now) const {
  return now - unused_since_ > kLasts ? unused_for_ : std::string_view{};
}

} // namespace locus::velodyne

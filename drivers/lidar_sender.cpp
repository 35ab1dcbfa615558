// SPDX-License-Identifier: Apache-2.0
#include "drivers/lidar_sender.hpp"

#include <algorithm>

namespace locus {

bool LidarSender::may_have_sent(const Datagram& datagram) const {
  if (configured_ip_)
    return *configured_ip_ == datagram.source_ip;
  return !learnt_ip_ || *learnt_ip_ == datagram.source_ip || is_silent_at(datagram.receive_stamp);
}

bool LidarSender::is_silent_at(Stamp now) const {
  constexpr Duration kTimeout = std::chrono::seconds{1};
  return !learnt_ip_ || now - last_received_ > kTimeout;
}

void LidarSender::accept(const Datagram& datagram) {
  learnt_ip_ = datagram.source_ip;
  last_received_ = datagram.receive_stamp;
}

void LidarSender::reject(const Datagram& datagram) {
  rejected_ip_ = datagram.source_ip;
  const auto known = std::ranges::find_if(
      others_, [&](const OtherSender& other) { return other.packets == 0 || other.ip == datagram.source_ip; });
  if (known != others_.end())
    *known = {datagram.source_ip, known->packets + 1, datagram.receive_stamp};
}

} // namespace locus

// SPDX-License-Identifier: Apache-2.0
#include "daemon/dds/sweep_points.hpp"

#include <algorithm>

namespace locus::daemon {

void sweep_points(std::span<const SweepPoint> points, std::span<const SurfacePoint> deskewed,
                  std::vector<CloudMessage::Point>& out) {
  out.clear();
  for (std::size_t i = 0; i < std::min(points.size(), deskewed.size()); ++i) {
    const Eigen::Vector3f& p = deskewed[i].position_m;
    const SweepPoint& point = points[i];
    out.push_back({p.x(), p.y(), p.z(), point.intensity, -point.age_s,
                   static_cast<std::uint16_t>(point.scan_line % 256),
                   static_cast<std::uint16_t>(point.scan_line / 256)});
  }
}

} // namespace locus::daemon

// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/sweep_clouds.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

namespace locus::tools {

SweepClouds::SweepClouds(SweepFolder folder, double raised_deg) : folder_(std::move(folder)), raised_deg_(raised_deg) {}

const Datagram* SweepClouds::next() {
  while (next_sweep_ < folder_.sweeps.size()) {
    const SweepFolder::Sweep& sweep = folder_.sweeps[next_sweep_++];
    if (const auto problem = folder_.read(sweep, raised_deg_, points_)) {
      if (damaged_++ == 0)
        first_problem_ = fmt::format("{}: {}", sweep.file.string(), *problem);
      continue;
    }
    const Stamp stamp = std::max(sweep.stamp, Stamp{Duration{1}}); // KITTI starts at 0, which would mean no stamp
    cloud_ = points_.view(stamp);
    datagram_ = {};
    datagram_.receive_stamp = stamp + folder_.step;
    datagram_.cloud = &cloud_;
    ++datagrams_;
    return &datagram_;
  }
  return nullptr;
}

std::string SweepClouds::why_none() const {
  return fmt::format("none of its {} sweeps can be read; {}", folder_.sweeps.size(), first_problem_);
}

std::vector<std::string> SweepClouds::warnings() const {
  if (damaged_ == 0)
    return {};
  return {fmt::format("{} ({} of {} sweeps cannot be read and are skipped; this is the first)", first_problem_,
                      damaged_, folder_.sweeps.size())};
}

double SweepClouds::progress() const {
  return static_cast<double>(next_sweep_) / static_cast<double>(folder_.sweeps.size());
}

} // namespace locus::tools

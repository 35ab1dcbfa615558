// SPDX-License-Identifier: Apache-2.0
#include "simulated_time/listener.hpp"

#include <string_view>

namespace locus::test {

namespace ros = daemon::ros;
using daemon::TopicQos;

Listener::Listener(const daemon::DdsNode& node)
    : odometry_(node, "/locus/odometry", {true, 100}), beginning_(node, "/locus/beginning", TopicQos::latch()) {}

std::vector<Listener::Estimate> Listener::new_estimates() {
  std::vector<Estimate> all;
  odometry_.take([&](const ros::Odometry& m) {
    const auto& [p, q] = m.pose_.pose_;
    all.push_back({stamp_from_ns(m.header_.stamp_.sec_ * std::int64_t{1'000'000'000} + m.header_.stamp_.nanosec_),
                   {Eigen::Quaterniond(q.w_, q.x_, q.y_, q.z_), {p.x_, p.y_, p.z_}}});
  });
  return all;
}

std::vector<Listener::Beginning> Listener::new_beginnings() {
  std::vector<Beginning> all;
  beginning_.take([&](const ros::DiagnosticArray& m) {
    for (std::uint32_t i = 0; i < m.status_._length; ++i) {
      const ros::DiagnosticStatus& status = m.status_._buffer[i];
      Beginning beginning;
      for (std::uint32_t k = 0; k < status.values_._length; ++k) {
        const ros::KeyValue& value = status.values_._buffer[k];
        if (std::string_view{value.key_} == "from")
          beginning.from = value.value_;
        else if (std::string_view{value.key_} == "t_ns")
          beginning.stamp = stamp_from_ns(std::stoll(value.value_));
      }
      all.push_back(std::move(beginning));
    }
  });
  return all;
}

} // namespace locus::test

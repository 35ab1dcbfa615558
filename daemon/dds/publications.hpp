// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "daemon/dds/dds_node.hpp"

namespace locus::daemon {

/// Writers of ROS 2 topics on the network, as DDS discovers them (built-in topic DCPSPublication). One owner.
class Publications {
 public:
  explicit Publications(const DdsNode& node)
      : reader_(dds_create_reader(node.participant(), DDS_BUILTIN_TOPIC_DCPSPUBLICATION, nullptr, nullptr)) {}

  /// Passes the writers discovered since the last call to `use(topic, type)`: the topic as in ROS 2, such as "/points",
  /// and the DDS name of its type. Bounded; the next call continues.
  template <class Use> void take(const Use& use) {
    constexpr std::string_view kOfRos = "rt/";
    constexpr std::uint32_t kBatch = 256;
    std::array<void*, kBatch> samples{};
    std::array<dds_sample_info_t, kBatch> infos{};
    const dds_return_t count = dds_take(reader_.handle(), samples.data(), infos.data(), kBatch, kBatch);
    for (std::size_t i = 0; count > 0 && i < static_cast<std::size_t>(count); ++i) {
      const auto* const writer = static_cast<const dds_builtintopic_endpoint_t*>(samples[i]);
      const std::string_view name = infos[i].valid_data ? writer->topic_name : "";
      if (name.starts_with(kOfRos))
        use(std::string{name.substr(kOfRos.size() - 1)}, std::string_view{writer->type_name});
    }
    if (count > 0)
      dds_return_loan(reader_.handle(), samples.data(), count);
  }
  [[nodiscard]] dds_entity_t handle() const { return reader_.handle(); }

 private:
  DdsEntity reader_;
};

} // namespace locus::daemon

// SPDX-License-Identifier: Apache-2.0
#include "bags/reception_order.hpp"

#include <algorithm>
#include <utility>

namespace locus::tools {

void ReceptionOrder::add(std::int64_t topic, std::int64_t recorded_ns) {
  const auto [found, is_new] = topics_.try_emplace(topic, Topic{recorded_ns});
  Topic& of_topic = found->second;
  if (std::exchange(of_topic.latest_ns, recorded_ns) - kLeastStepBack.count() > recorded_ns)
    most_steps_ = std::max(most_steps_, ++of_topic.steps_back);
}

} // namespace locus::tools

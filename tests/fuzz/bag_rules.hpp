// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>

#include "bags/bag.hpp"
#include "fuzz/fuzz_bytes.hpp"

namespace locus::fuzz {

/// Checks the invariants of every bag, valid or not.
inline void demand_rules_of_bags(const std::filesystem::path& path) {
  const auto bag = tools::open_bag(path);
  if (!bag) {
    demand(bag.error().starts_with(path.string() + ": ") && bag.error().find('\n') == std::string::npos);
    return;
  }
  const auto count = [&bag] {
    (*bag)->rewind();
    std::size_t messages = 0;
    for (const tools::BagMessage* message = (*bag)->next(); message != nullptr; message = (*bag)->next(), ++messages)
      demand(message->topic < (*bag)->topics().size() && (*bag)->progress() <= 1.0);
    return messages;
  };
  const std::size_t at_first = count(), then = count(); // a topic may be announced only after its first messages
  demand(at_first <= then && then == count());
}

} // namespace locus::fuzz

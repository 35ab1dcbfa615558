// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdlib>

#include "core/base/stamp.hpp"

namespace locus::test {

/// Returns the longest wait of a test for an event that must come: 60 s, or LOCUS_TEST_PATIENCE_S. A wait ends with its
/// event, so that only a failing test spends it. No wait is shorter, because none measures the speed of the machine.
inline Duration patience() {
  const char* seconds = std::getenv("LOCUS_TEST_PATIENCE_S"); // NOLINT(concurrency-mt-unsafe): nobody sets it
  return std::chrono::seconds{seconds != nullptr ? std::atoll(seconds) : 60};
}

} // namespace locus::test

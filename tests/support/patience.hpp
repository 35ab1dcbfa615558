// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdlib>

#include "core/base/stamp.hpp"

namespace locus::test {

/// Longest wait of a test for an event that must come: 60 s, or LOCUS_TEST_PATIENCE_S. A wait ends with its event, so
/// patience costs time only where a test fails; no wait is shorter, for none measures the machine.
inline Duration patience() {
  const char* seconds = std::getenv("LOCUS_TEST_PATIENCE_S"); // NOLINT(concurrency-mt-unsafe): nobody sets it
  return std::chrono::seconds{seconds != nullptr ? std::atoll(seconds) : 60};
}

} // namespace locus::test

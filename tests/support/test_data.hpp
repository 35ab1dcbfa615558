// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>
#include <filesystem>

namespace locus::test {

/// Where the real captures lie. May not exist: a test that needs them skips with a message.
inline std::filesystem::path test_data() {
  const char* from_environment = std::getenv("LOCUS_TEST_DATA"); // NOLINT(concurrency-mt-unsafe): nobody sets it
  return from_environment != nullptr ? from_environment : LOCUS_TEST_DATA;
}

} // namespace locus::test
